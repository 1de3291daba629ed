/* Private to the runtime: memory barriers between producer and consumer. */
#ifndef DAC_BARRIERS_H
#define DAC_BARRIERS_H

#include "dac_config.h"

/* The other side sees writes in order. On a single core a compiler barrier would be enough. */
#ifndef DAC_RELEASE
#if defined(__GNUC__)
#define DAC_RELEASE() __atomic_thread_fence(__ATOMIC_RELEASE)
#define DAC_ACQUIRE() __atomic_thread_fence(__ATOMIC_ACQUIRE)
#elif defined(__STDC_VERSION__) && __STDC_VERSION__ >= 201112L
#include <stdatomic.h>
#define DAC_RELEASE() atomic_thread_fence(memory_order_release)
#define DAC_ACQUIRE() atomic_thread_fence(memory_order_acquire)
#else
#error "define DAC_RELEASE() and DAC_ACQUIRE() as fences of your compiler"
#endif
#endif

#endif
