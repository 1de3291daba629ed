/* The memory order of the sequencer as ThreadSanitizer sees it.
 *
 * The words that two threads share are volatile, and the compiler tells of each access to one by a call
 * (`distinguish-volatile`). The fences, DAC_RELEASE() and DAC_ACQUIRE(), are calls to this file. From both it tells the
 * sanitizer what the fences of C11 would order, and no more: an access to a bank or a table that is ordered by no pair
 * of fences is reported as a race, also where this processor would have kept the order by itself.
 *
 * Requests in the queue are checked as well, though they are volatile: fence_check() names them.
 *
 * A release makes a token. A thread that writes a shared word puts its latest token on it; a thread that reads the word
 * and then acquires has what came before that token. This file is compiled without the sanitizer.
 */
#include <stdint.h>

void __tsan_acquire(void *token);
void __tsan_release(void *token);
void fence_release(void);
void fence_acquire(void);
void fence_check(const volatile void *words, unsigned size);

#define TOKENS 65536
#define WORDS 4096 /* shared words, by their address */

static char tokens[2][TOKENS];
static void *published[WORDS];
static int threads;

static struct {
    uintptr_t first, size;
} checked[2];
static int checks;

static __thread int thread = -1;
static __thread unsigned next_token, read_words;
static __thread void *latest;
static __thread uint16_t words_read[WORDS];   /* since the last acquire, */
static __thread uint8_t is_among_them[WORDS]; /* each of them once */

static unsigned place(const void *word)
{
    return (uintptr_t)word % WORDS;
}

static void reads(const void *word)
{
    const unsigned at = place(word);
    if (!is_among_them[at])
        words_read[read_words++] = (uint16_t)at;
    is_among_them[at] = 1;
}

static void writes(const void *word)
{
    __atomic_store_n(&published[place(word)], latest, __ATOMIC_SEQ_CST);
}

void fence_release(void)
{
    if (thread < 0)
        thread = __atomic_fetch_add(&threads, 1, __ATOMIC_SEQ_CST);
    latest = &tokens[thread & 1][next_token++ % TOKENS];
    __tsan_release(latest);
    __atomic_thread_fence(__ATOMIC_SEQ_CST);
}

void fence_acquire(void)
{
    __atomic_thread_fence(__ATOMIC_SEQ_CST);
    while (read_words != 0) {
        const unsigned at = words_read[--read_words];
        void *const token = __atomic_load_n(&published[at], __ATOMIC_SEQ_CST);
        is_among_them[at] = 0;
        if (token != 0)
            __tsan_acquire(token);
    }
}

/* Before there are two threads. */
void fence_check(const volatile void *words, unsigned size)
{
    checked[checks].first = (uintptr_t)words;
    checked[checks++].size = size;
}

static int is_checked(const void *word)
{
    return (uintptr_t)word - checked[0].first < checked[0].size || (uintptr_t)word - checked[1].first < checked[1].size;
}

#define HOOKS(size)                                                                                                   \
    void __tsan_read##size(void *word);                                                                               \
    void __tsan_write##size(void *word);                                                                              \
    void __tsan_volatile_read##size(void *word);                                                                      \
    void __tsan_volatile_write##size(void *word);                                                                     \
    void __tsan_volatile_read##size(void *word)                                                                       \
    {                                                                                                                 \
        if (is_checked(word))                                                                                         \
            __tsan_read##size(word);                                                                                  \
        else                                                                                                          \
            reads(word);                                                                                              \
    }                                                                                                                 \
    void __tsan_volatile_write##size(void *word)                                                                      \
    {                                                                                                                 \
        if (is_checked(word))                                                                                         \
            __tsan_write##size(word);                                                                                 \
        else                                                                                                          \
            writes(word);                                                                                             \
    }
HOOKS(1)
HOOKS(2)
HOOKS(4)
HOOKS(8)
