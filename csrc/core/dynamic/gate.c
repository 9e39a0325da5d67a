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

#if defined(_MSC_VER) && !defined(__clang__)
static int64_t
load(volatile int64_t *x)
{
    return InterlockedCompareExchange64(x, 0, 0);
}
static int64_t
add(volatile int64_t *x, int64_t more)
{
    return InterlockedExchangeAdd64(x, more);
}
static void
store(volatile int64_t *x, int64_t value)
{
    (void)InterlockedExchange64(x, value);
}
static bool
swap_if(volatile int64_t *x, int64_t old, int64_t value)
{
    return InterlockedCompareExchange64(x, value, old) == old;
}
#else
HS_ALWAYS_INLINE int64_t
load(volatile int64_t *x)
{
    return __atomic_load_n(x, __ATOMIC_SEQ_CST);
}
HS_ALWAYS_INLINE int64_t
add(volatile int64_t *x, int64_t more)
{
    return __atomic_fetch_add(x, more, __ATOMIC_SEQ_CST);
}
HS_ALWAYS_INLINE void
store(volatile int64_t *x, int64_t value)
{
    __atomic_store_n(x, value, __ATOMIC_SEQ_CST);
}
HS_ALWAYS_INLINE bool
swap_if(volatile int64_t *x, int64_t old, int64_t value)
{
    return __atomic_compare_exchange_n(x, &old, value, false, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST);
}
#endif

typedef struct hs_queue {
    hs_mutex     mutex;
    hs_condition changed;
} hs_queue;

bool
hs_gate_init(hs_gate *gate)
{
    gate->state = gate->waiting = 0;
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
    const int64_t state = load(&gate->state);
    return state >= 0 && swap_if(&gate->state, state, state + 1);
}

static bool
try_write(hs_gate *gate)
{
    return swap_if(&gate->state, 0, -1);
}

/* Where threads of a parent were inside when this process was forked off, they never leave. */
static void
forget_the_parent(hs_gate *gate)
{
    const int64_t process = CURRENT_PROCESS();
    if (gate->process != process) {
        gate->process = process;
        gate->state = gate->waiting = 0;
        hs_mutex_init(&gate->queue->mutex);
        hs_condition_init(&gate->queue->changed);
    }
}

/* A wait ends on its own after a while, so that a wake-up that came too early costs time only. */
static HS_NO_INLINE void
wait_for(hs_gate *gate, bool (*try_enter)(hs_gate *))
{
    forget_the_parent(gate);
    hs_mutex_lock(&gate->queue->mutex);
    (void)add(&gate->waiting, 1);
    while (!try_enter(gate)) {
        hs_condition_wait_briefly(&gate->queue->changed, &gate->queue->mutex);
    }
    (void)add(&gate->waiting, -1);
    hs_mutex_unlock(&gate->queue->mutex);
}

static void
wake(hs_gate *gate)
{
    if (load(&gate->waiting) > 0) {
        hs_mutex_lock(&gate->queue->mutex);
        hs_condition_wake(&gate->queue->changed);
        hs_mutex_unlock(&gate->queue->mutex);
    }
}

void
hs_gate_read(hs_gate *gate)
{
    if (!try_read(gate) && !try_read(gate)) {
        wait_for(gate, try_read);
    }
}

void
hs_gate_read_end(hs_gate *gate)
{
    if (add(&gate->state, -1) == 1) {
        wake(gate);
    }
}

void
hs_gate_write(hs_gate *gate)
{
    if (!try_write(gate)) {
        wait_for(gate, try_write);
    }
}

void
hs_gate_write_end(hs_gate *gate)
{
    store(&gate->state, 0);
    wake(gate);
}
