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

static bool
is_free(void *context)
{
    hs_gate *gate = context;
    return hs_atomic_load(&gate->state) <= empty();
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
    *gate = (hs_gate){.state = empty()};
}

bool
hs_gate_is_mine(hs_gate *gate)
{
    const int64_t holder = hs_atomic_load(&gate->holder);
    return holder != 0 && holder == HS_THREAD_NUMBER() &&
           gate->held_at == hs_atomic_load(&hs_n_forks);
}

bool
hs_gate_read(hs_gate *gate)
{
    if (hs_gate_is_mine(gate)) {
        return false;
    }
    if (!try_read(gate) && !try_read(gate)) {
        hs_wait_for(try_read, gate);
    }
    return true;
}

void
hs_gate_read_end(hs_gate *gate)
{
    if (hs_atomic_add(&gate->state, -1) % WRITER == 1) {
        wake();
    }
}

/* A writer that waits gives up what readers may need to get out, and takes it back before it goes
 * in: never the other way round. */
static HS_NO_INLINE void
wait_to_write(hs_gate *gate)
{
    if (gate->pause == NULL) {
        hs_wait_for(try_write, gate);
        return;
    }
    do {
        void *const paused = gate->pause();
        hs_wait_for(is_free, gate);
        gate->resume(paused);
    } while (!try_write(gate));
}

bool
hs_gate_write(hs_gate *gate)
{
    if (hs_gate_is_mine(gate)) {
        return false;
    }
    if (!try_write(gate) && !try_write(gate)) {
        wait_to_write(gate);
    }
    return true;
}

void
hs_gate_write_end(hs_gate *gate)
{
    hs_atomic_store(&gate->state, empty());
    wake();
}

bool
hs_gate_hold(hs_gate *gate)
{
    const bool went_in = hs_gate_write(gate);
    if (went_in) {
        gate->held_at = hs_atomic_load(&hs_n_forks);
        hs_atomic_store(&gate->holder, HS_THREAD_NUMBER());
    }
    return went_in;
}

void
hs_gate_release(hs_gate *gate)
{
    hs_atomic_store(&gate->holder, 0);
    hs_gate_write_end(gate);
}
