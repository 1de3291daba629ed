/* What ports to processors with a Cortex-M7 share: its interrupt controller and its caches, under the names of Arm's
 * generic user guide, DUI 0646. */
#ifndef CORTEX_M7_H
#define CORTEX_M7_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))

#define NVIC_ISER0 REGISTER(0xE000E100)
#define NVIC_ISER1 REGISTER(0xE000E104)
#define NVIC_IPR(interrupt) (*(volatile uint8_t *)(uintptr_t)(0xE000E400 + (interrupt)))
#define SCB_VTOR REGISTER(0xE000ED08)
#define SCB_CCR REGISTER(0xE000ED14)
#define SCB_CCSIDR REGISTER(0xE000ED80)
#define SCB_CSSELR REGISTER(0xE000ED84)
#define SCB_ICIALLU REGISTER(0xE000EF50)
#define SCB_DCIMVAC REGISTER(0xE000EF5C)
#define SCB_DCISW REGISTER(0xE000EF60)
#define SCB_DCCMVAC REGISTER(0xE000EF68)
enum { CACHE_LINE = 32 }; /* bytes */

static inline void barrier(void)
{
    __asm__ volatile("dsb\n\tisb" ::: "memory");
}

static inline void clean(const volatile void *from, uint32_t bytes)
{
    const uint32_t first = (uint32_t)(uintptr_t)from;

    barrier();
    for (uint32_t at = first; at != first + bytes; at += CACHE_LINE)
        SCB_DCCMVAC = at;
    barrier();
}

static inline void invalidate(const volatile void *from, uint32_t bytes)
{
    const uint32_t first = (uint32_t)(uintptr_t)from;

    barrier();
    for (uint32_t at = first; at != first + bytes; at += CACHE_LINE)
        SCB_DCIMVAC = at;
    barrier();
}

/* After a reset the data cache has anything in it: it is invalidated, all sets and ways, before it is switched on. */
static inline void start_caches(void)
{
    SCB_ICIALLU = 0;
    barrier();
    SCB_CCR |= UINT32_C(1) << 17;
    SCB_CSSELR = 0;
    barrier();
    const uint32_t geometry = SCB_CCSIDR;
    for (uint32_t set = 0; set <= (geometry >> 13 & 0x7fff); set++)
        for (uint32_t way = 0; way <= (geometry >> 3 & 0x3ff); way++) /* of which there are four */
            SCB_DCISW = way << 30 | set << 5;
    barrier();
    SCB_CCR |= UINT32_C(1) << 16;
    barrier();
}

#endif
