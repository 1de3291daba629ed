/* Does with a device what link_device.py wrote down that it did with one, and prints what leaves it. For other
 * processors and compilers. Each line of the input is a letter and what belongs to it:
 *     S numbers    what the device is: the fields of device_setup, the boot count last
 *     Q numbers    the sine
 *     B hex        what uploads the program that it boots with
 *     r hex        bytes from the line; f hex  the same, and the main loop does not go round
 *     w n, t n k   the main loop n times; n ticks, after each the main loop at most k times
 *     F numbers    it has a flash from now on, which is empty: the layout, and whether it is written while a scan plays
 *     L bytes      an upload whose program is one more of the library
 *     P number     the application plays a program of the device
 *     p, s, b, k, c   interlock, line stalled, reset with a boot count, a damaged word, the clock
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "link_device.h"

enum { LONGEST = 1 << 18, SINES = 5 << 14 };

static char line[LONGEST];
static uint8_t bytes[LONGEST];
static int32_t sine[SINES];
static dac_program boot;
static char *at;

static long number(void)
{
    return strtol(at, &at, 10);
}

static size_t hexadecimal(void)
{
    size_t count = 0;
    unsigned byte;

    for (at++; sscanf(at, "%2x", &byte) == 1; at += 2)
        bytes[count++] = (uint8_t)byte;
    return count;
}

static void read_converter(dac_converter *c)
{
    c->bits = (uint8_t)number();
    c->word_bits = (uint8_t)number();
    c->twos_complement = number() != 0;
    c->left_aligned = number() != 0;
    c->power_up_code = (int32_t)number();
}

static uint32_t read_setup(device_setup *s)
{
    read_converter(&s->x_converter);
    read_converter(&s->y_converter);
    for (int i = 0; i < 4; i++)
        s->x_limits[i] = (uint32_t)strtoul(at, &at, 10);
    for (int i = 0; i < 4; i++)
        s->y_limits[i] = (uint32_t)strtoul(at, &at, 10);
    s->x_word_bits = (uint8_t)number();
    s->x_index_bits = (uint8_t)number();
    s->y_word_bits = (uint8_t)number();
    s->y_index_bits = (uint8_t)number();
    s->harmonics = (uint16_t)number();
    s->sine_index_bits = (uint8_t)number();
    s->window = (uint8_t)number();
    s->update_rate_hz = (uint32_t)number();
    s->key_bytes = (uint8_t)number();
    for (int i = 0; i < 32; i++)
        s->key[i] = (uint8_t)number();
    s->knows_hash = (uint8_t)number();
    for (int i = 0; i < 32; i++)
        s->hash[i] = (uint8_t)number();
    s->has_interlock = (uint8_t)number();
    s->identity_bytes = (uint8_t)number();
    for (int i = 0; i < 32; i++)
        s->identity[i] = (uint8_t)number();
    s->boot_persists = (uint8_t)number();
    s->sine = sine;
    return (uint32_t)strtoul(at, &at, 10);
}

static const dac_word *copy_table(const dac_axis_program *axis)
{
    dac_word *const table = calloc(axis->length + DAC_WORDS_BEHIND, sizeof(dac_word));

    if (table == NULL)
        exit(1);
    memcpy(table, axis->table, axis->length * sizeof(dac_word));
    for (unsigned i = 0; i < DAC_WORDS_BEHIND; i++)
        table[axis->length + i] = table[i];
    return table;
}

/* The program that an upload brings, in memory of its own; the device starts anew. */
static dac_program read_program(device *d, size_t count)
{
    dac_program program;

    for (size_t i = 0; i < count; i += 256) {
        device_feed(d, bytes + i, count - i < 256 ? count - i : 256);
        device_run(d, UINT32_MAX);
    }
    device_take(d, bytes);
    dac_link_program_of(&d->link, &program);
    program.x.table = copy_table(&program.x);
    program.y.table = copy_table(&program.y);
    return program;
}

static void keep_boot(device *d, size_t count)
{
    boot = read_program(d, count);
    d->setup.boot_program = &boot;
    device_start(d, d->boot);
}

#if DAC_LIBRARY
static char names[COMPILED][256];

static void name_next(const device *d)
{
    char *const name = names[d->config.library_programs];

    (void)snprintf(name, sizeof names[0], "%.255s", at + 1);
    name[strcspn(name, "\n")] = '\0';
}

static void add_program(device *d, size_t count)
{
    static dac_program programs[COMPILED];
    static char hashes[COMPILED][65];
    const uint32_t number = d->config.library_programs;

    programs[number] = read_program(d, count);
    for (unsigned i = 0; i < 32; i++)
        (void)sprintf(hashes[number] + 2 * i, "%02x", d->link.image[d->link.idle].info[i]);
    device_compile(d, names[number], hashes[number], &programs[number]);
    device_start(d, d->boot);
}
#endif

#if DAC_STORE
static uint8_t cells[1 << 14];

static bool erase_sector(uint32_t address);
static bool write_line(uint32_t address, const uint8_t *from);
static bool read_cells(uint32_t address, uint8_t *to, uint32_t count);
static dac_store_flash flash = {erase_sector, write_line, read_cells, 0, 0, 0, 0};

static bool erase_sector(uint32_t address)
{
    memset(cells + address, 0xFF, flash.sector_bytes);
    return true;
}

static bool write_line(uint32_t address, const uint8_t *from)
{
    memcpy(cells + address, from, DAC_STORE_LINE);
    return true;
}

static bool read_cells(uint32_t address, uint8_t *to, uint32_t count)
{
    memcpy(to, cells + address, count);
    return true;
}

static void give_flash(device *d)
{
    memset(cells, 0xFF, sizeof cells);
    flash.base = (uint32_t)number();
    flash.sector_bytes = (uint32_t)number();
    flash.place_sectors = (uint32_t)number();
    flash.slots = (uint8_t)number();
    device_keep(d, &flash, number() != 0);
}
#endif

int main(void)
{
    static device_setup setup;
    device *d = NULL;
    uint32_t count = 0;

    while (fgets(line, sizeof line, stdin) != NULL) {
        const char what = line[0];
        at = line + 1;
        if (what == 'S') {
            count = read_setup(&setup);
        } else if (what == 'Q') {
            for (size_t i = 0; i < SINES && *at == ' '; i++)
                sine[i] = (int32_t)number();
            d = device_new(&setup, count);
            for (unsigned fault = 0; fault <= FAULTS; fault++)
                (void)device_refusal(d, fault);
        } else if (d == NULL) {
            return 1;
#if DAC_STORE
        } else if (what == 'F') {
            give_flash(d);
#endif
#if DAC_LIBRARY
        } else if (what == 'P') {
            (void)device_play(d, (uint32_t)number());
            device_run(d, UINT32_MAX);
        } else if (what == 'N') {
            name_next(d);
        } else if (what == 'L') {
            add_program(d, hexadecimal());
#endif
        } else if (what == 'B') {
            keep_boot(d, hexadecimal());
        } else if (what == 'r' || what == 'f') {
            device_feed(d, bytes, hexadecimal());
            if (what == 'r')
                device_run(d, UINT32_MAX);
        } else if (what == 'w') {
            device_run(d, (unsigned)number());
        } else if (what == 't') {
            const uint32_t ticks = (uint32_t)number();
            device_tick(d, ticks, (unsigned)strtoul(at, &at, 10));
        } else if (what == 'p') {
            device_permit(d, number() != 0);
        } else if (what == 's') {
            device_stall(d, number() != 0);
        } else if (what == 'c') {
            device_set_clock((uint32_t)strtoul(at, &at, 10));
        } else if (what == 'b') {
            device_start(d, (uint32_t)strtoul(at, &at, 10));
        } else if (what == 'k') {
            const unsigned axis = (unsigned)number();
            const uint32_t word = (uint32_t)number();
            device_poke(d, axis, word, (int32_t)number());
        } else {
            return 1;
        }
        const size_t sent = d == NULL ? 0 : device_take(d, bytes);
        for (size_t i = 0; i < sent; i++)
            printf("%02x", bytes[i]);
        if (sent != 0)
            printf("\n");
    }
    if (d == NULL)
        return 1;
    const size_t records = device_records(d, NULL);
    line_record *const record = calloc(records + 1, sizeof *record);
    if (record == NULL)
        return 1;
    device_records(d, record);
    for (size_t i = 0; i < records; i++)
        printf("%" PRIu32 " %" PRIu32 " %" PRIu32 " %08" PRIx32 " %02x %02x\n", record[i].generation, record[i].line,
               record[i].ticks, record[i].crc, record[i].markers, record[i].faults);
    free(record);
    device_delete(d);
    return 0;
}
