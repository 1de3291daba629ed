/* Random numbers and time for the key of the link.
 *
 * WHERE THE NUMBERS COME FROM. The boards of QEMU have no generator. Here they are those of the machine that runs QEMU,
 * from its /dev/urandom, by semihosting (`make run` switches it on). On hardware write random_bytes() anew, for a
 * generator that its manual calls fit for keys: RNG of an STM32, TRNG of an RP2350 or an nRF52. Neither a clock nor
 * memory at power-up nor a converter's noise is one: who can foresee the numbers, or have them again, needs no key.
 * Without a generator keep a boot count in non-volatile memory instead (`boot_persists` in dac_link.h).
 */
#include "random.h"

#include "semihosting.h"

#ifndef UPDATE_RATE_HZ
#define UPDATE_RATE_HZ 20000
#endif

void random_bytes(uint8_t bytes[16])
{
    static const char source[] = "/dev/urandom";
    const uintptr_t open[] = {(uintptr_t)source, HOST_BINARY, sizeof source - 1};
    const uintptr_t file = host_call(HOST_OPEN, open), read[] = {file, (uintptr_t)bytes, 16};

    while (file == UINTPTR_MAX || host_call(HOST_READ, read) != 0) {
    } /* no numbers, no challenge: the link falls silent, the samples go on */
    (void)host_call(HOST_CLOSE, &file);
}

static volatile uint32_t milliseconds;

void clock_tick(void)
{
    static uint32_t thousandths; /* of a period, beyond the last millisecond */

    thousandths += 1000;
    if (thousandths >= UPDATE_RATE_HZ) {
        thousandths -= UPDATE_RATE_HZ;
        milliseconds = milliseconds + 1;
    }
}

uint32_t clock_milliseconds(void)
{
    return milliseconds;
}
