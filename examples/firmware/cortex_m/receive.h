/* A queue of characters from the interrupt of a UART to the main loop. Neither side waits. */
#ifndef RECEIVE_H
#define RECEIVE_H

#include <stdint.h>

enum { RECEIVED = 256 }; /* a power of two; longer lines lose characters, but not their end */

typedef struct {
    volatile char characters[RECEIVED];
    volatile uint32_t head, tail;
} receive_queue;

static inline void received(receive_queue *queue, char c)
{
    const uint32_t head = queue->head;
    if (head - queue->tail == RECEIVED) {
        /* A lost end would leave the line without an answer. The reader is far from the newest character. */
        if (c == '\n')
            queue->characters[(head - 1) % RECEIVED] = c;
        return;
    }
    queue->characters[head % RECEIVED] = c;
    queue->head = head + 1; /* volatile accesses stay in order on a single core */
}

static inline int receive(receive_queue *queue)
{
    const uint32_t tail = queue->tail;
    if (tail == queue->head)
        return -1;
    const char c = queue->characters[tail % RECEIVED];
    queue->tail = tail + 1;
    return (unsigned char)c;
}

#endif
