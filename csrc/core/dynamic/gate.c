/* SPDX-License-Identifier: BSD-3-Clause */
/* gate.c: the way in is one compare-and-swap; threads that do not get in sleep until one leaves. */
#if !defined(_WIN32) && !defined(_POSIX_C_SOURCE)
#define _POSIX_C_SOURCE 200809L
#endif
#include "gate.h"

#include "../base/os_thread.h"
#include "../memory/account.h"

#if defined(_WIN32)
#define CURRENT_PROCESS() 0 /* no fork */
#else
#include <unistd.h>
#define CURRENT_PROCESS() ((int64_t)getpid())
#endif

typedef struct hs_queue {
    hs_mutex     mutex;
    hs_condition changed;
} hs_queue;

bool
hs_gate_init(hs_gate *gate)
{
    gate->state = gate->waiting = gate->holder = 0;
    gate->pause = NULL;
    gate->resume = NULL;
    gate->process = CURRENT_PROCESS();
    gate->queue = hs_alloc(NULL, HS_FOR_CELLS, 1, sizeof *gate->queue);
    if (gate->queue != NULL) {
        hs_mutex_init(&gate->queue->mutex);
        hs_condition_init(&gate->queue->changed);
    }
    return gate->queue != NULL;
}

void
hs_gate_destroy(hs_gate *gate)
{
    hs_condition_destroy(&gate->queue->changed);
    hs_mutex_destroy(&gate->queue->mutex);
    hs_free(NULL, gate->queue);
}

/* One more reader, or the writer. */
static bool
try_read(hs_gate *gate)
{
    const int64_t state = hs_atomic_load(&gate->state);
    return state >= 0 && hs_atomic_swap_if(&gate->state, state, state + 1);
}

static bool
try_write(hs_gate *gate)
{
    return hs_atomic_swap_if(&gate->state, 0, -1);
}

/* Where threads of a parent were inside when this process was forked off, they never leave. */
static void
forget_the_parent(hs_gate *gate)
{
    const int64_t process = CURRENT_PROCESS();
    if (gate->process != process) {
        gate->process = process;
        gate->state = gate->waiting = gate->holder = 0;
        hs_mutex_init(&gate->queue->mutex);
        hs_condition_init(&gate->queue->changed);
    }
}

/* Asleep until the gate may be free. A wait ends on its own after a while, so that a wake-up that
 * came too early costs time only. */
static void
sleep_once(hs_gate *gate, bool writes)
{
    hs_mutex_lock(&gate->queue->mutex);
    const int64_t state = hs_atomic_load(&gate->state);
    if (writes ? state != 0 : state < 0) {
        hs_condition_wait_briefly(&gate->queue->changed, &gate->queue->mutex);
    }
    hs_mutex_unlock(&gate->queue->mutex);
}

/* A writer that waits gives up what readers may need to get out, and takes it back before it goes
 * in: never the other way round. */
static HS_NO_INLINE void
wait_for(hs_gate *gate, bool writes)
{
    forget_the_parent(gate);
    (void)hs_atomic_add(&gate->waiting, 1);
    while (!(writes ? try_write(gate) : try_read(gate))) {
        const bool  pauses = writes && gate->pause != NULL;
        void *const paused = pauses ? gate->pause() : NULL;
        sleep_once(gate, writes);
        if (pauses) {
            gate->resume(paused);
        }
    }
    (void)hs_atomic_add(&gate->waiting, -1);
}

static void
wake(hs_gate *gate)
{
    if (hs_atomic_load(&gate->waiting) > 0) {
        hs_mutex_lock(&gate->queue->mutex);
        hs_condition_wake(&gate->queue->changed);
        hs_mutex_unlock(&gate->queue->mutex);
    }
}

bool
hs_gate_is_mine(hs_gate *gate)
{
    const int64_t holder = hs_atomic_load(&gate->holder);
    return holder != 0 && holder == HS_THREAD_NUMBER();
}

bool
hs_gate_read(hs_gate *gate)
{
    if (hs_gate_is_mine(gate)) {
        return false;
    }
    if (!try_read(gate) && !try_read(gate)) {
        wait_for(gate, false);
    }
    return true;
}

void
hs_gate_read_end(hs_gate *gate)
{
    if (hs_atomic_add(&gate->state, -1) == 1) {
        wake(gate);
    }
}

bool
hs_gate_write(hs_gate *gate)
{
    if (hs_gate_is_mine(gate)) {
        return false;
    }
    if (!try_write(gate)) {
        wait_for(gate, true);
    }
    return true;
}

void
hs_gate_write_end(hs_gate *gate)
{
    hs_atomic_store(&gate->state, 0);
    wake(gate);
}

bool
hs_gate_hold(hs_gate *gate)
{
    const bool went_in = hs_gate_write(gate);
    if (went_in) {
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
