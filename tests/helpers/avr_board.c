/* An Arduino in simavr with a converter MCP4922 on SPI: mega|uno FIRMWARE END, where END is the end of its static
 * memory.
 *
 * Commands are lines "CYCLES BYTES"; so many cycles are played, in which the bytes (hexadecimal, or "-") arrive at UART
 * 0 at 115200 baud. The answer is "SENT WORDS LOST FREE": what the UART sent; what both channels put out each time that
 * LDAC fell, 8 digits; how many bytes waited longer than the UART can hold two more; the fewest bytes that the stack
 * left free. */
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { HZ = 16000000, BYTE = HZ / 11520, HELD = 2, MOST = 1 << 20 };
enum { SPCR = 0x4C, SPSR = 0x4D, SPDR = 0x4E, TIMSK1 = 0x6F, UCSR0A = 0xC0, UDR0 = 0xC6 };
enum { SPIF = 1 << 7, RXC = 1 << 7 };

static unsigned char sent[MOST], arriving[MOST];
static unsigned sent_bytes, arriving_bytes, given;
static char words[MOST];
static unsigned words_length;
static unsigned selected, shifted, shifts, codes[2], written;
static avr_cycle_count_t shifted_at;
static avr_cycle_count_t waits_since; /* the byte that was received first, and not read yet */
static unsigned lost, least_free = 65535;
static avr_io_read_t read_udr;

static void on_select(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq, (void)parameter;
    if (value && selected && shifts == 2) {
        if ((shifted & 0x7000) != 0x3000) {
            fprintf(stderr, "the converter does not take %04x\n", shifted);
            exit(1);
        }
        codes[shifted >> 15] = shifted & 0xFFF;
        written |= 1u << (shifted >> 15);
    }
    selected = !value;
    shifts = 0;
}

/* simavr has 100 us for a byte, whatever the clock of SPI is. */
static void on_spi(struct avr_t *avr, avr_io_addr_t address, uint8_t value, void *parameter)
{
    static const unsigned clocks[] = {4, 16, 64, 128};

    (void)address, (void)parameter;
    shifted = (shifted << 8 | value) & 0xFFFF;
    shifts++;
    avr->data[SPSR] &= (uint8_t)~SPIF;
    shifted_at = avr->cycle + 8u * (clocks[avr->data[SPCR] & 3] >> (avr->data[SPSR] & 1));
}

static void on_latch(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq, (void)parameter;
    if (!value && written == 3 && words_length + 9 < MOST)
        words_length += (unsigned)sprintf(words + words_length, "%04x%04x", codes[0], codes[1]);
}

static void on_sent(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq, (void)parameter;
    if (sent_bytes < MOST)
        sent[sent_bytes++] = (unsigned char)value;
}

static uint8_t on_read(struct avr_t *avr, avr_io_addr_t address, void *parameter)
{
    if (waits_since != 0 && avr->cycle - waits_since > HELD * BYTE)
        lost++;
    waits_since = 0;
    return read_udr(avr, address, parameter);
}

/* It would write to the answers. */
static void quiet(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr, (void)level, (void)format, (void)arguments;
}

int main(int count, char **arguments)
{
    static elf_firmware_t firmware;
    unsigned long cycles;
    static char bytes[2 * MOST];
    avr_cycle_count_t end = 0, next_byte = 0;
    bool on = false;

    avr_global_logger_set(quiet);
    if (count != 4 || elf_read_firmware(arguments[2], &firmware) != 0)
        return 2;
    const bool uno = strcmp(arguments[1], "uno") == 0; /* pins 10 and 9: PB2, PB1, or PB4, PH6 */
    const unsigned static_end = (unsigned)strtoul(arguments[3], NULL, 0);
    avr_t *const avr = avr_make_mcu_by_name(uno ? "atmega328p" : "atmega2560");
    avr_init(avr);
    firmware.frequency = HZ;
    avr_load_firmware(avr, &firmware);
    avr->frequency = HZ;
    avr->sleep = avr_callback_sleep_raw;
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POLL_SLEEP);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_sent, NULL);
    avr->io[AVR_DATA_TO_IO(SPDR)].w.c = on_spi;
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), uno ? 2 : 4), on_select, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(uno ? 'B' : 'H'), uno ? 1 : 6), on_latch, NULL);
    read_udr = avr->io[AVR_DATA_TO_IO(UDR0)].r.c;
    avr->io[AVR_DATA_TO_IO(UDR0)].r.c = on_read;
    while (scanf("%lu %2097151s", &cycles, bytes) == 2) {
        if (bytes[0] != '-') {
            if (given == arriving_bytes) {
                given = arriving_bytes = 0;
                next_byte = (next_byte > end ? next_byte : end) + BYTE;
            }
            for (const char *at = bytes; at[0] != 0 && arriving_bytes < MOST; at += 2) {
                unsigned value;
                sscanf(at, "%2x", &value);
                arriving[arriving_bytes++] = (unsigned char)value;
            }
        }
        for (end += cycles; avr->cycle < end;) {
            const int state = avr_run(avr);
            if (state == cpu_Done || state == cpu_Crashed)
                return 1;
            while (given != arriving_bytes && avr->cycle >= next_byte) {
                avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), arriving[given++]);
                next_byte += BYTE;
            }
            if (shifted_at != 0 && avr->cycle >= shifted_at) {
                avr->data[SPSR] |= SPIF;
                shifted_at = 0;
            }
            if (waits_since == 0 && (avr->data[UCSR0A] & RXC) != 0)
                waits_since = avr->cycle;
            on |= avr->data[TIMSK1] != 0; /* before, the stack is not where it belongs */
            const unsigned stack = avr->data[R_SPL] | (unsigned)avr->data[R_SPH] << 8;
            if (on && stack - static_end < least_free)
                least_free = stack - static_end;
        }
        for (unsigned i = 0; i < sent_bytes; i++)
            printf("%02x", sent[i]);
        printf("%s %s %u %u\n", sent_bytes ? "" : "-", words_length ? words : "-", lost, least_free);
        fflush(stdout);
        sent_bytes = words_length = 0;
        words[0] = 0;
    }
    return 0;
}
