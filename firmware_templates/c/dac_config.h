/* The options of the runtime, each with its default.
 *
 * To choose another value, define it in a header of your own and name that to the compiler, for all files:
 * -DDAC_CONFIG_FILE='"my_dac_config.h"'. It can take the widths from a scan, so that they follow it:
 *
 *     #include "annexin_200nm.h"
 *     #define DAC_TABLE_STORAGE_BITS ANNEXIN_200NM_TABLE_STORAGE_BITS
 *
 * Or give single options to the compiler with -D, or change a copy of this file. A package for Arduino, PlatformIO or
 * ESP-IDF brings what its scan needs in tablegen_options.h. Options are plain numbers, the same for all files: objects
 * that were compiled with different ones do not link (with an assembler of GNU or LLVM for ELF).
 */
#ifndef DAC_CONFIG_H
#define DAC_CONFIG_H

#ifdef DAC_CONFIG_FILE
#include DAC_CONFIG_FILE
#endif
#ifdef __has_include
#if __has_include("tablegen_options.h") /* of a package: what its scan needs, for options that have no value yet */
#include "tablegen_options.h"
#endif
#endif

#ifndef DAC_TABLE_STORAGE_BITS
#define DAC_TABLE_STORAGE_BITS 16 /* bits of a table word in memory: 16, or 32 for tables of 17 to 24 bits */
#endif
#ifndef DAC_OUTPUT_STORAGE_BITS
#define DAC_OUTPUT_STORAGE_BITS 16 /* bits of a converter word in memory: 16, or 32 for converters of 17 to 24 bits */
#endif

#ifndef DAC_SPLINE
#define DAC_SPLINE 0 /* 1: plays cubic tables too, of up to 16384 words of 21 bits */
#endif

#ifndef DAC_STRIDE
#define DAC_STRIDE 2 /* distance of two words of an axis: 2 if x and y alternate in a buffer, 1 if each has its own */
#endif

#ifndef DAC_SHAPING
#define DAC_SHAPING 0 /* highest order of shaped output: 0 none, 1 first, 2 second, 3 scanner */
#endif
#if DAC_SHAPING < 0 || DAC_SHAPING > 3
#error "DAC_SHAPING is 0, 1, 2 or 3"
#endif

#ifndef DAC_COMMIT_MODES
#define DAC_COMMIT_MODES 0 /* 1: has dac_sequencer_commit_at() */
#endif

#ifndef DAC_SLOW_PART
#define DAC_SLOW_PART 0 /* 1: plays programs with a slow part */
#endif

#ifndef DAC_PIXEL_TABLE
#define DAC_PIXEL_TABLE 0 /* 1: plays programs with a table of the ticks of each pixel */
#endif

#ifndef DAC_PROGMEM
#define DAC_PROGMEM 0 /* 1, on an AVR: tables are in flash, and are read there; the link has its own in RAM */
#endif
#if DAC_PROGMEM && (DAC_SLOW_PART || DAC_PIXEL_TABLE)
#error "DAC_PROGMEM has no slow parts and no tables of pixels"
#endif
#if DAC_PROGMEM
#include <avr/pgmspace.h>
#define DAC_TABLE_ATTR PROGMEM
#if DAC_TABLE_STORAGE_BITS == 16
#define DAC_TABLE_WORD(word) ((dac_word)pgm_read_word(&(word)))
#else
#define DAC_TABLE_WORD(word) ((dac_word)pgm_read_dword(&(word)))
#endif
#else
#define DAC_TABLE_WORD(word) (word) /* reads a word of a table */
#endif

#ifndef DAC_REQUESTS
#define DAC_REQUESTS 8 /* requests that may wait for a tick: a power of two, at most 128 */
#endif

#ifndef DAC_CODE_ATTR
#define DAC_CODE_ATTR /* where the functions of the consumer are placed, for example a section in RAM */
#endif

#ifndef DAC_WAIT
#define DAC_WAIT 8 /* ticks that are played one by one after a refused run, before the next run is tried */
#endif

/* 1: runs add products of 64 bits. 0: they use 32 bits, for processors where such a sum takes a call, or more
 * instructions than with 32 bits: on RISC-V that is so with words of 16 bits. */
#ifndef DAC_LONG_MULTIPLY
#if defined(__ARM_ARCH_6M__) || defined(__ARM_ARCH_8M_BASE__) || defined(__AVR__)
#define DAC_LONG_MULTIPLY 0
#elif defined(__riscv) && __riscv_xlen == 32 && (DAC_TABLE_STORAGE_BITS == 16 || !defined(__riscv_mul))
#define DAC_LONG_MULTIPLY 0
#else
#define DAC_LONG_MULTIPLY 1
#endif
#endif

#ifndef DAC_SMALL
#if defined(__OPTIMIZE_SIZE__)
#define DAC_SMALL 1 /* renders Fourier words with less code, but about eight times the instructions */
#else
#define DAC_SMALL 0
#endif
#endif

/* DAC_RELEASE() and DAC_ACQUIRE(), the fences between producer and consumer, have their defaults in dac_barriers.h. */

/* The serial link. */

#ifndef DAC_LINK_RING
#if defined(__AVR__)
#define DAC_LINK_RING 512 /* of the 8 KB of the largest Arduino with an AVR */
#else
#define DAC_LINK_RING 2048
#endif
/* bytes received but not processed yet: a power of two, 512..32768; a frame takes 256 */
#endif

#ifndef DAC_LINK_SLICE
#define DAC_LINK_SLICE 64 /* words, or received bytes, that one call of dac_link_work() processes */
#endif

#ifndef DAC_LINK_CHALLENGE_MS
#define DAC_LINK_CHALLENGE_MS 10000 /* how long the nonce of a CHALLENGE may be used */
#endif

/* Kept programs. */

#ifndef DAC_STORE
#define DAC_STORE 0 /* 1: dac_store.c has code, and the link has requests that need it */
#endif

/* A library of programs. */

#ifndef DAC_LIBRARY
#define DAC_LIBRARY 0 /* 1: the link plays programs of the device by number, compiled and kept ones; 2: hosts ask too */
#endif

/* Moves. */

#ifndef DAC_MOVE
#define DAC_MOVE 0 /* 1: the link takes MOVE, new gain and offset words of the program that plays */
#endif
#if DAC_MOVE && !DAC_COMMIT_MODES
#undef DAC_COMMIT_MODES
#define DAC_COMMIT_MODES 1 /* a move goes on with the frame */
#endif

/* The output z. */

#ifndef DAC_LINK_Z
#define DAC_LINK_Z 0 /* 1: the link may have a second sequencer, whose x is z */
#endif
#if DAC_LINK_Z && (DAC_MOVE || DAC_STORE || DAC_LIBRARY)
#error "DAC_LINK_Z has no moves, no kept programs and no programs by number"
#endif
#if DAC_LINK_Z
#define DAC_CONFIG_Z "+65536" /* behind the bytes of the ring */
#else
#define DAC_CONFIG_Z
#endif

/* Every object defines a symbol whose value has the options on which types and calls depend. A linker accepts this
 * again and again with one value, and refuses a second value. It takes no memory and no instruction. */
#if defined(__GNUC__) && defined(__ELF__)
#define DAC_CONFIG_TEXT(option) #option
#define DAC_CONFIG_VALUE(option) "(" DAC_CONFIG_TEXT(option) ")"
#define DAC_CONFIG_SYMBOL(name, value) __asm__(".hidden " name "\n.globl " name "\n" name " = " value "\n");
DAC_CONFIG_SYMBOL("dac_objects_need_the_same_options",
                  "(((((((((((((" DAC_CONFIG_VALUE(DAC_PROGMEM) "*2+" DAC_CONFIG_VALUE(
                      DAC_PIXEL_TABLE) ")*2+" DAC_CONFIG_VALUE(
                      DAC_MOVE) ")*2+" DAC_CONFIG_VALUE(DAC_SLOW_PART) ")*4+" DAC_CONFIG_VALUE(
                      DAC_TABLE_STORAGE_BITS) "/16)*4+" DAC_CONFIG_VALUE(
                      DAC_OUTPUT_STORAGE_BITS) "/16)*256+" DAC_CONFIG_VALUE(DAC_STRIDE) ")*4+" DAC_CONFIG_VALUE(
                      DAC_SHAPING) ")*2+" DAC_CONFIG_VALUE(DAC_SPLINE) ")*256+" DAC_CONFIG_VALUE(
                      DAC_REQUESTS) ")*2+" DAC_CONFIG_VALUE(DAC_LONG_MULTIPLY) ")*2+" DAC_CONFIG_VALUE(
                      DAC_COMMIT_MODES) ")*2+" DAC_CONFIG_VALUE(DAC_STORE) ")*4+" DAC_CONFIG_VALUE(DAC_LIBRARY) ")")
DAC_CONFIG_SYMBOL("dac_objects_need_the_same_link_ring", DAC_CONFIG_VALUE(DAC_LINK_RING) DAC_CONFIG_Z)
#endif

#endif
