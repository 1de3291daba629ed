/* Lines to and from a human, or a test. */
#ifndef CONSOLE_H
#define CONSOLE_H

#include <stdbool.h>
#include <stdint.h>

void console_received(char c); /* from the interrupt of the UART */

/* A whole line that has come in, without its end, or NULL. */
char *console_line(void);

void console_text(const char *text);
void console_number(const char *name, uint32_t value); /* " name value" */

/* Whether a line begins with this word; *rest is moved to what follows it. */
bool console_word(char **rest, const char *word);
/* A decimal number, which ends the line; false if there is none. */
bool console_decimal(const char *rest, uint32_t *value);

#endif
