/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * gate.h: a lock that many readers may hold at once, or one writer. Free, it costs two atomic
 * instructions a call, which is what a list of a hundred nanoseconds a call can afford; only a
 * thread that has to wait calls the system.
 */
#ifndef HS_GATE_H
#define HS_GATE_H

#include "../base/base.h"

/* How many readers are inside, or that a writer is, and after how many forks (os_thread.h). */
typedef struct hs_gate {
    volatile int64_t state;
    volatile int64_t holder;  /* number of the thread that is the writer for many calls; 0: none */
    int64_t          held_at; /* how many forks there had been when it became that */
    void *(*pause)(void);     /* around each wait of a writer; NULL: nothing is done */
    void (*resume)(void *paused);
} hs_gate;

void hs_gate_init(hs_gate *gate);

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
