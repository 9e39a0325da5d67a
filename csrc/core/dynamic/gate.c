/* SPDX-License-Identifier: BSD-3-Clause */
/* gate.c: the way in is one compare-and-swap; threads that do not get in sleep until one leaves. */
#if !defined(_WIN32) && !defined(_POSIX_C_SOURCE)
#define _POSIX_C_SOURCE 200809L
#endif
#include "gate.h"

#include "../base/os_thread.h"

#define WRITER      (INT64_C(1) << 31)
#define PER_PROCESS (INT64_C(1) << 32)

/* The state where no thread of this process is inside. */
static int64_t
empty(void)
{
    return hs_atomic_load(&hs_n_forks) * PER_PROCESS;
}

/* Adds to what is inside, unless that is too much; threads of a parent are not. */
static bool
try_enter(hs_gate *gate, int64_t most, int64_t more)
{
    const int64_t state = hs_atomic_load(&gate->state), none = empty();
    const int64_t inside = state < none ? 0 : state - none;
    return inside <= most && hs_atomic_swap_if(&gate->state, state, none + inside + more);
}

static bool
try_read(void *gate)
{
    return try_enter(gate, WRITER - 2, 1);
}

static bool
try_write(void *gate)
{
    return try_enter(gate, 0, WRITER);
}

static void
wake(void)
{
    if (hs_atomic_load(&hs_n_waiting) > 0) {
        hs_wake_waiting();
    }
}

void
hs_gate_init(hs_gate *gate)
{
    gate->state = empty();
}

void
hs_gate_read(hs_gate *gate)
{
    if (!try_read(gate) && !try_read(gate)) {
        hs_wait_for(try_read, gate);
    }
}

void
hs_gate_read_end(hs_gate *gate)
{
    if (hs_atomic_add(&gate->state, -1) % WRITER == 1) {
        wake();
    }
}

void
hs_gate_write(hs_gate *gate)
{
    if (!try_write(gate)) {
        hs_wait_for(try_write, gate);
    }
}

void
hs_gate_write_end(hs_gate *gate)
{
    hs_atomic_store(&gate->state, empty());
    wake();
}
