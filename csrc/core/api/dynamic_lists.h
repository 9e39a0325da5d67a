/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_API_DYNAMIC_LISTS_H
#define HS_API_DYNAMIC_LISTS_H

#include "../base/os.h"
#include "../base/status.h"
#include "../dynamic/dynamic.h"

/*
 * dynamic_lists.h: the functions of halfshell_dynamic.h: arguments are checked and the list is
 * held here, the work is done in dynamic/.
 */

/* What each public function of a hs_dynamic does first and last. */

typedef struct hs_dynamic_call {
    hs_fpenv env;
    bool     writes;
    bool     went_in; /* false: this thread holds the list */
} hs_dynamic_call;

/* Waits until the list may be used, and sets the rounding mode. */
HS_ALWAYS_INLINE hs_dynamic_call
hs_dynamic_enter(const hs_dynamic *list, bool writes)
{
    hs_gate        *gate = &((hs_dynamic *)list)->gate; /* it changes, the list does not */
    hs_dynamic_call call = {.writes = writes};
    call.went_in = writes ? hs_gate_write(gate) : hs_gate_read(gate);
    if (call.went_in) {
        call.env = hs_fpenv_enter();
    }
    return call;
}

HS_ALWAYS_INLINE void
hs_dynamic_leave(const hs_dynamic *list, hs_dynamic_call call)
{
    hs_gate *gate = &((hs_dynamic *)list)->gate;
    if (call.went_in) {
        hs_fpenv_leave(call.env);
        if (call.writes) {
            hs_gate_write_end(gate);
        } else {
            hs_gate_read_end(gate);
        }
    }
}

/* Where a failure goes. */
HS_ALWAYS_INLINE hs_failure *
hs_failure_or(hs_failure *failure, hs_failure *ignored)
{
    failure = failure != NULL ? failure : ignored;
    *failure = HS_NO_FAILURE;
    return failure;
}

/* The caller's numbers, each read once. */
HS_ALWAYS_INLINE void
hs_read_position(const hs_dynamic *list, const double *position, double *own)
{
    for (int k = 0; k < list->lattice.ndim; k++) {
        own[k] = ((const volatile double *)position)[k];
    }
}

#endif
