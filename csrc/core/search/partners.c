/* SPDX-License-Identifier: BSD-3-Clause */
/* partners.c: pairs are transposed twice, which leaves the rows ascending. */
#include "partners.h"

#include "../base/starts.h"

#include <string.h>

/* Room for rows of so many numbers, all of them empty. The length of row r is then counted at
 * first[r + 2]; once they are summed, row r is filled from first[r + 1] on, which becomes where the
 * next one begins. */
static bool
open_rows(hs_account *account, int64_t n_rows, int64_t n_numbers, hs_partners *rows)
{
    rows->first = hs_alloc(account, HS_FOR_CANDIDATES, n_rows + 2, sizeof *rows->first);
    rows->number = hs_alloc(account, HS_FOR_CANDIDATES, n_numbers, sizeof *rows->number);
    if (rows->first == NULL || rows->number == NULL) {
        return false;
    }
    memset(rows->first, 0, (size_t)(n_rows + 2) * sizeof *rows->first);
    return true;
}

void
hs_partners_free(hs_account *account, hs_partners *rows)
{
    hs_free(account, rows->first);
    hs_free(account, rows->number);
    *rows = (hs_partners){NULL, NULL};
}

/* One of both points of an excluded pair: the asking one, or the other. */
HS_ALWAYS_INLINE int64_t
number_in(const hs_selection *selection, int64_t pair, int which)
{
    return selection->excluded[2 * pair + which];
}

/* Pairs by their second point: each way round, but for those with queries. */
static void
fill_by_second(const hs_selection *selection, int n_ways, int64_t n_rows, hs_partners *rows)
{
    for (int64_t e = 0; e < selection->n_excluded; e++) {
        for (int way = 0; way < n_ways; way++) {
            rows->first[number_in(selection, e, 1 - way) + 2]++;
        }
    }
    hs_starts_of_lengths(rows->first + 1, n_rows + 1);
    for (int64_t e = 0; e < selection->n_excluded; e++) {
        for (int way = 0; way < n_ways; way++) {
            const int64_t at = rows->first[number_in(selection, e, 1 - way) + 1]++;
            rows->number[at] = (int32_t)number_in(selection, e, way);
        }
    }
}

static void
transpose(const hs_partners *from, int64_t n_from, int64_t n_to, hs_partners *to)
{
    for (int64_t p = 0; p < from->first[n_from]; p++) {
        to->first[from->number[p] + 2]++;
    }
    hs_starts_of_lengths(to->first + 1, n_to + 1);
    for (int64_t r = 0; r < n_from; r++) {
        for (int64_t p = from->first[r]; p < from->first[r + 1]; p++) {
            to->number[to->first[from->number[p] + 1]++] = (int32_t)r;
        }
    }
}

hs_status
hs_partners_check(const hs_selection *selection, int64_t n_asking, int64_t n_points,
                  hs_failure *failure)
{
    for (int64_t e = 0; e < selection->n_excluded; e++) {
        const int64_t i = number_in(selection, e, 0), j = number_in(selection, e, 1);
        if (i < 0 || i >= n_asking || j < 0 || j >= n_points) {
            failure->row = e;
            return HS_ERR_ARGUMENT;
        }
    }
    return HS_OK;
}

hs_status
hs_partners_open(const hs_selection *selection, int64_t n_asking, int64_t n_points,
                 bool has_queries, hs_account *account, hs_partners *partners, hs_failure *failure)
{
    const int       n_ways = has_queries ? 1 : 2;
    const int64_t   n_numbers = selection->n_excluded * n_ways;
    hs_partners     by_second = {NULL, NULL};
    const hs_status status = hs_partners_check(selection, n_asking, n_points, failure);
    if (status != HS_OK) {
        return status;
    }
    const bool is_open = open_rows(account, n_asking, n_numbers, partners) &&
                         open_rows(account, n_points, n_numbers, &by_second);
    if (is_open) {
        fill_by_second(selection, n_ways, n_points, &by_second);
        transpose(&by_second, n_points, n_asking, partners);
    }
    hs_partners_free(account, &by_second);
    return is_open ? HS_OK : HS_ERR_MEMORY;
}
