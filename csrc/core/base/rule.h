/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * rule.h: whose radius or support a rule looks at, that of the asking point, of the other one, or
 * of both. A side that a rule does not look at needs no values.
 */
#ifndef HS_RULE_H
#define HS_RULE_H

#include "../../halfshell.h"
#include "base.h"

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
