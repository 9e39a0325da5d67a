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
    int64_t          process; /* that made it: in a child, threads that were inside are gone */
    struct hs_queue *queue;   /* owned: where threads wait */
} hs_gate;

/* False when memory is refused. */
bool hs_gate_init(hs_gate *gate);
void hs_gate_destroy(hs_gate *gate);

void hs_gate_read(hs_gate *gate);
void hs_gate_read_end(hs_gate *gate);
void hs_gate_write(hs_gate *gate);
void hs_gate_write_end(hs_gate *gate);

#endif
