/* Lines to and from a human, or a test. */
#ifndef CONSOLE_H
#define CONSOLE_H

#include <stdbool.h>
#include <stdint.h>

void console_received(char c); /* called by the interrupt of the UART */

/* Returns a complete received line, without its end, or NULL. */
char *console_line(void);

void console_text(const char *text);
void console_number(const char *name, uint32_t value); /* " name value" */

/* Returns whether a line begins with this word; sets *rest to the text after it. */
bool console_word(char **rest, const char *word);
/* Reads a decimal number at the end of the line; returns false if there is none. */
bool console_decimal(const char *rest, uint32_t *value);

#endif
