/* SPDX-License-Identifier: BSD-3-Clause */
/* labels.c: one loop without branches for each test; it writes each hit, and goes on behind those
 * that stay. */
#include "labels.h"

#include <string.h>

static bool
has_partner(const hs_asking *asking, int32_t number)
{
    const int32_t *partner = asking->partner;
    int64_t        first = 0, n = asking->n_partners;
    while (n > 1) { /* it is at first or behind it, if at all */
        const int64_t half = n / 2;
        first += partner[first + half] <= number ? half : 0;
        n -= half;
    }
    return partner[first] == number;
}

/* Whether labels differ by at most so much; their difference may pass int64. */
HS_ALWAYS_INLINE bool
are_near(int64_t one, int64_t other, uint64_t within)
{
    const uint64_t more = one > other ? (uint64_t)one - (uint64_t)other
                                      : (uint64_t)other - (uint64_t)one;
    return more <= within;
}

HS_ALWAYS_INLINE bool
is_left_out(const hs_asking *asking, int32_t id, const hs_label_test test)
{
    switch (test) {
    case HS_OF_OTHER_GROUP: return asking->label[id] != asking->own;
    case HS_OF_EQUAL_LABEL: return asking->label[id] == asking->own && id != asking->itself;
    case HS_OF_NEAR_LABEL:
        return are_near(asking->label[id], asking->own, asking->within) && id != asking->itself;
    default:
        return (asking->bits >> (id & 63) & 1) && has_partner(asking, id) && id != asking->itself;
    }
}

bool
hs_labels_find(const hs_choice *choice, int32_t point, hs_asking *asking, hs_label_test *test)
{
    *asking = (hs_asking){.itself = choice->has_queries ? -1 : point};
    *test = HS_OF_PARTNER;
    if (choice->label != NULL) {
        asking->label = choice->label;
        asking->own = choice->asking_label[point];
        asking->within = choice->within;
        *test = choice->within == 0 ? HS_OF_EQUAL_LABEL : HS_OF_NEAR_LABEL;
        return true;
    }
    const hs_partners *partners = &choice->partners;
    if (partners->first == NULL) {
        return false;
    }
    asking->partner = partners->number + partners->first[point];
    asking->n_partners = partners->first[point + 1] - partners->first[point];
    for (int64_t p = 0; p < asking->n_partners && asking->bits != UINT64_MAX; p++) {
        asking->bits |= UINT64_C(1) << (asking->partner[p] & 63);
    }
    return asking->n_partners > 0;
}

HS_ALWAYS_INLINE int32_t
sift(const hs_scanner *scanner, hs_scan *scan, const hs_asking *asking, int32_t from, int32_t end,
     int32_t to, const hs_label_test test, const bool by_id)
{
    int32_t *hits = scan->hits;
    float   *squares = scan->squares;
    for (int32_t h = from; h < end; h++) {
        const int32_t hit = hits[h];
        const int32_t id = by_id ? hit : hs_hit_number(scanner, hit);
        hits[to] = hit;
        if (squares != NULL) {
            squares[to] = squares[h];
        }
        to += !is_left_out(asking, id, test);
    }
    return to;
}

bool
hs_labels_leave_out(const hs_asking *asking, int32_t number, hs_label_test test)
{
    switch (test) {
    case HS_OF_EQUAL_LABEL: return is_left_out(asking, number, HS_OF_EQUAL_LABEL);
    case HS_OF_NEAR_LABEL: return is_left_out(asking, number, HS_OF_NEAR_LABEL);
    default: return is_left_out(asking, number, HS_OF_PARTNER);
    }
}

int32_t
hs_labels_sift(const hs_scanner *scanner, hs_scan *scan, const hs_asking *asking, int32_t from,
               int32_t end, int32_t to, hs_label_test test)
{
    const bool by_id = scanner->scans == HS_BLOCK_LISTS_IDS;
    switch (test) {
    case HS_OF_OTHER_GROUP:
        return by_id ? sift(scanner, scan, asking, from, end, to, HS_OF_OTHER_GROUP, true)
                     : sift(scanner, scan, asking, from, end, to, HS_OF_OTHER_GROUP, false);
    case HS_OF_EQUAL_LABEL:
        return by_id ? sift(scanner, scan, asking, from, end, to, HS_OF_EQUAL_LABEL, true)
                     : sift(scanner, scan, asking, from, end, to, HS_OF_EQUAL_LABEL, false);
    case HS_OF_NEAR_LABEL:
        return by_id ? sift(scanner, scan, asking, from, end, to, HS_OF_NEAR_LABEL, true)
                     : sift(scanner, scan, asking, from, end, to, HS_OF_NEAR_LABEL, false);
    default:
        return by_id ? sift(scanner, scan, asking, from, end, to, HS_OF_PARTNER, true)
                     : sift(scanner, scan, asking, from, end, to, HS_OF_PARTNER, false);
    }
}

int32_t
hs_labels_sift_groups(const hs_scanner *scanner, hs_scan *scan, int32_t point, int32_t from,
                      int32_t end, int32_t to)
{
    const hs_choice *choice = scanner->search->call->choice;
    const size_t     n = (size_t)(end - from);
    if (choice->group != NULL) {
        const hs_asking asking = {.label = choice->group, .own = choice->asking_group[point]};
        return hs_labels_sift(scanner, scan, &asking, from, end, to, HS_OF_OTHER_GROUP);
    }
    if (to < from) {
        memmove(scan->hits + to, scan->hits + from, n * sizeof *scan->hits);
        if (scan->squares != NULL) {
            memmove(scan->squares + to, scan->squares + from, n * sizeof *scan->squares);
        }
    }
    return to + (int32_t)n;
}
