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
} hs_gate;

void hs_gate_init(hs_gate *gate);

void hs_gate_read(hs_gate *gate);
void hs_gate_read_end(hs_gate *gate);
void hs_gate_write(hs_gate *gate);
void hs_gate_write_end(hs_gate *gate);

#endif
