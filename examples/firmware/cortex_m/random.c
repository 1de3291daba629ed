/* Random numbers and time for the key of the link.
 *
 * WHERE THE NUMBERS COME FROM. The boards of QEMU have no generator. Here they are those of the machine that runs QEMU,
 * from its /dev/urandom, by semihosting (`make run` switches it on): calls of a debugger, as in Arm's "Semihosting for
 * AArch32 and AArch64". On hardware write random_bytes() anew, for a generator that its manual calls fit for keys: RNG
 * of an STM32, TRNG of an RP2350 or an nRF52. Neither a clock nor memory at power-up nor a converter's noise is one:
 * who can foresee the numbers, or have them again, needs no key. Without a generator keep a boot count in non-volatile
 * memory instead (`boot_persists` in dac_link.h).
 */
#include "random.h"

#ifndef UPDATE_RATE_HZ
#define UPDATE_RATE_HZ 20000
#endif

enum { OPEN = 1, CLOSE = 2, READ = 6, BINARY = 1 }; /* semihosting calls; a mode of OPEN */

static uintptr_t host(uintptr_t call, const uintptr_t *arguments)
{
    register uintptr_t r0 __asm__("r0") = call;
    register const uintptr_t *r1 __asm__("r1") = arguments;

    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void random_bytes(uint8_t bytes[16])
{
    static const char source[] = "/dev/urandom";
    const uintptr_t open[] = {(uintptr_t)source, BINARY, sizeof source - 1};
    const uintptr_t file = host(OPEN, open), read[] = {file, (uintptr_t)bytes, 16};

    while (file == UINTPTR_MAX || host(READ, read) != 0) {
    } /* no numbers, no challenge: the link falls silent, the samples go on */
    (void)host(CLOSE, &file);
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
