#include <stddef.h>

#include "board.h"
#include "console.h"
#include "receive.h"

enum { LINE = 80 };

static receive_queue input;

void console_received(char c)
{
    received(&input, c);
}

char *console_line(void)
{
    static char line[LINE];
    static unsigned length;
    int c;

    while ((c = receive(&input)) >= 0) {
        if (c == '\n' || c == '\r') {
            if (length == 0)
                continue; /* skip the second character of "\r\n" */
            line[length] = 0;
            length = 0;
            return line;
        }
        if (length < LINE - 1)
            line[length++] = (char)c;
    }
    return NULL;
}

void console_text(const char *text)
{
    while (*text != 0)
        board_putc(*text++);
}

void console_number(const char *name, uint32_t value)
{
    char digits[11];
    unsigned at = sizeof digits - 1;

    digits[at] = 0;
    do {
        digits[--at] = (char)('0' + value % 10);
        value /= 10;
    } while (value != 0);
    board_putc(' ');
    console_text(name);
    board_putc(' ');
    console_text(digits + at);
}

bool console_word(char **rest, const char *word)
{
    char *at = *rest;

    while (*word != 0)
        if (*at++ != *word++)
            return false;
    if (*at != 0 && *at != ' ')
        return false;
    while (*at == ' ')
        at++;
    *rest = at;
    return true;
}

bool console_decimal(const char *rest, uint32_t *value)
{
    uint32_t number = 0;

    if (*rest == 0)
        return false;
    for (; *rest != 0; rest++) {
        if (*rest < '0' || *rest > '9' || number > UINT32_C(99999999))
            return false;
        number = number * 10 + (uint32_t)(*rest - '0');
    }
    *value = number;
    return true;
}
