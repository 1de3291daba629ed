/* avr_count FIRMWARE: runs avr_chains.c on an ATmega2560 in simavr, and counts the instructions and the cycles of what
 * GPIOR0 names. Prints a line each time: its number, instructions, cycles, and the bytes that follow at GPIOR1. */
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdio.h>

enum { HZ = 16000000, GPIOR0 = 0x3E, GPIOR1 = 0x4A };

static unsigned long long instructions, first_instruction;
static avr_cycle_count_t first_cycle;
static unsigned name;

static void named(struct avr_t *avr, avr_io_addr_t address, uint8_t value, void *unused)
{
    (void)address, (void)unused;
    if (value == 0)
        printf("\n%u %llu %llu ", name, instructions - first_instruction,
               (unsigned long long)(avr->cycle - first_cycle));
    name = value;
    first_instruction = instructions;
    first_cycle = avr->cycle;
}

static void told(struct avr_t *avr, avr_io_addr_t address, uint8_t value, void *unused)
{
    (void)avr, (void)address, (void)unused;
    printf("%02x", value);
}

int main(int count, char **arguments)
{
    elf_firmware_t firmware = {0};
    avr_t *avr = avr_make_mcu_by_name("atmega2560");
    int state = cpu_Running;

    if (count != 2 || avr == NULL || elf_read_firmware(arguments[1], &firmware) != 0)
        return 2;
    avr_init(avr);
    firmware.frequency = HZ;
    avr_load_firmware(avr, &firmware);
    avr_register_io_write(avr, GPIOR0, named, NULL);
    avr_register_io_write(avr, GPIOR1, told, NULL);
    while (state != cpu_Done && state != cpu_Crashed) {
        state = avr_run(avr);
        instructions++;
    }
    printf("\n");
    return state == cpu_Done ? 0 : 1;
}
