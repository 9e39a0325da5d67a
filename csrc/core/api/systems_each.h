/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * systems_each.h: one call of a public search for each of many systems. Threads take ranges of
 * them; each call has one thread, what it finds goes behind what those before it found, with
 * numbers among the points of all. Half lists have a loop of their own (systems_thread.h), which
 * keeps the search of one system for the next.
 */
#ifndef HS_SYSTEMS_EACH_H
#define HS_SYSTEMS_EACH_H

#include "system_part.h"
#include "../collect/columns.h"
#include "../threads/call.h"

/* Searches a system. *pairs, NULL before, receives what goes to the output, to be freed. */
typedef hs_status (*hs_system_fn)(void *context, const hs_system_part *part,
                                  const hs_options *options, hs_pairs **pairs, hs_failure *failure);

/* What to do, all borrowed. */
typedef struct hs_systems_each {
    hs_system_sets sets;
    hs_system_fn   search;
    void          *context;
    bool           has_limit; /* the cutoff, or a reach, is the limit of pairs */
    hs_output     *output;    /* where pairs go, with the columns that the options want; or NULL */
} hs_systems_each;

/* Checks what the systems share, also where there are none, and does it, for a call that has been
 * entered. total->done.pairs becomes their number, failure->system the one that fails. */
hs_status hs_systems_do_each(const hs_systems_each *each, hs_call *total, hs_failure *failure);

#endif
