/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_BASE_STATUS_H
#define HS_BASE_STATUS_H

#include "../../halfshell.h"
#include "base.h"

/*
 * status.h: status codes and their texts, how inner steps end, and the tables of quantities and
 * rules.
 */

/*
 * A failure that is still to be told, and how a step inside the core can end besides with a status
 * of halfshell.h. Each function that returns one of these says so; none reaches the caller of the
 * library.
 */

/* A failure without details. */
#define HS_NO_FAILURE ((hs_failure){.row = -1, .column = -1, .system = -1})

/* What was kept (cells, a tree, a list) does not serve: it is to be made anew. */
#define HS_REBUILD ((hs_status)(HS_STATUS_END + 1))

/* There is more than this method is made for: the caller takes another one. */
#define HS_TRY_OTHER ((hs_status)(HS_STATUS_END + 2))

/* The work ended here because something else did: a visitor left, or another thread has failed. */
#define HS_STOPPED ((hs_status)(HS_STATUS_END + 3))

/* The caller's function has seen enough pairs: all threads stop, and that is no failure. */
#define HS_ENOUGH ((hs_status)(HS_STATUS_END + 4))

/*
 * The quantities of a pair, in the order of their HS_WANT_ bits: how many bytes each takes
 * and which purpose these bytes are counted under. The one place that knows.
 */

#define HS_QUANTITIES 7 /* one for each HS_WANT_ bit */

/* Every HS_WANT_ bit that needs no other options. */
#define HS_WANT_ALL (2u * HS_WANT_BOTH - 1u)

/* Bytes of one pair in the columns of all HS_WANT_ bits of `want`. index_bytes: 4 or 8, of i and
 * j. */
int64_t hs_want_bytes(unsigned want, int ndim, int index_bytes);

/* The number of a bit, from 0 on; HS_QUANTITIES for what is not one bit of them. */
int hs_want_number(unsigned bit);

/* What the bytes of quantity number k are counted as. */
hs_purpose hs_want_purpose(int k);

/*
 * Whose radius or support a rule looks at, that of the asking point, of the other one, or of both.
 * A side that a rule does not look at needs no values.
 */

HS_ALWAYS_INLINE bool
hs_rule_needs_asking(hs_rule rule)
{
    return rule != HS_RULE_SCATTER;
}

HS_ALWAYS_INLINE bool
hs_rule_needs_other(hs_rule rule)
{
    return rule != HS_RULE_GATHER;
}

/* Whether a pair may be within one way round and beyond the other: not for half lists. */
HS_ALWAYS_INLINE bool
hs_rule_is_directed(hs_rule rule)
{
    return !(hs_rule_needs_asking(rule) && hs_rule_needs_other(rule));
}

#endif
