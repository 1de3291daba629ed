/* Calls of a debugger, here of QEMU, as in Arm's "Semihosting for AArch32 and AArch64". Without one that listens the
 * processor stops at the first. */
#ifndef SEMIHOSTING_H
#define SEMIHOSTING_H

#include <stdint.h>

enum { HOST_OPEN = 1, HOST_CLOSE = 2, HOST_WRITEC = 3, HOST_READ = 6 };
enum { HOST_BINARY = 1 }; /* a mode of HOST_OPEN */

static inline uintptr_t host_call(uintptr_t call, const void *arguments)
{
    register uintptr_t r0 __asm__("r0") = call;
    register const void *r1 __asm__("r1") = arguments;

    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

#endif
