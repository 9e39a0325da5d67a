/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * gate.h: a lock that many readers may hold at once, or one writer. Free, it costs two atomic
 * instructions a call, which is what a list of a hundred nanoseconds a call can afford; only a
 * thread that has to wait calls the system.
 */
#ifndef HS_GATE_H
#define HS_GATE_H

#include "../base/base.h"

typedef struct hs_gate {
    volatile int64_t state;   /* readers inside, or -1: a writer */
    volatile int64_t waiting; /* threads */
    volatile int64_t holder;  /* number of the thread that is the writer for many calls; 0: none */
    int64_t          process; /* that made it: in a child, threads that were inside are gone */
    struct hs_queue *queue;   /* owned: where threads wait */
    void *(*pause)(void);     /* around each wait of a writer; NULL: nothing is done */
    void (*resume)(void *paused);
} hs_gate;

/* False when memory is refused. */
bool hs_gate_init(hs_gate *gate);
void hs_gate_destroy(hs_gate *gate);

/* Go in, which `end` ends. False: this thread holds the gate, and is inside. */
bool hs_gate_read(hs_gate *gate);
void hs_gate_read_end(hs_gate *gate);
bool hs_gate_write(hs_gate *gate);
void hs_gate_write_end(hs_gate *gate);

/* A writer for many calls. False: this thread holds the gate already. */
bool hs_gate_hold(hs_gate *gate);
bool hs_gate_is_mine(hs_gate *gate); /* whether this thread holds it */
void hs_gate_release(hs_gate *gate); /* if it does */

#endif
