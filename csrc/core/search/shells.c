/* SPDX-License-Identifier: BSD-3-Clause */
/* shells.c: distances have an error of 1 ulp, or less than 2^-1073 below the normal numbers; the
 * band around an edge is some times as wide, which costs nothing. */
#include "shells.h"

#include <math.h>
#include <string.h>

/* Times a number: 4 ulp of it or more. */
#define BAND 0x1p-50

/* Eight of the smallest numbers there are. */
#define LEAST_BAND 0x1p-1071

/* Bits of a distance that choose its cell, of the 52 within a power of two: so that few edges share
 * a cell. The first is tried first. */
static const int cell_bits[] = {3, 6, 9};
#define MOST_CELLS 4096 /* some 100 kB; distances below these share cell 0 */

/* The bits of a number that is not negative. */
HS_ALWAYS_INLINE int64_t
bits_of(double x)
{
    int64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* The least number with these leading bits. */
static double
least_of(int64_t leading, int shift)
{
    const uint64_t bits = (uint64_t)leading << shift;
    double         x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* Cells from the one before the first edge above zero to that of the cutoff. Returns how many
 * edges share a cell with the one before, though their bands are apart. */
static int64_t
set_cells(double cutoff, int bits, hs_shells *shells)
{
    const int64_t n = shells->n;
    int64_t       k = 0, shared = 0;
    while (k < n - 1 && !(shells->low[k] > 0.0)) {
        k++;
    }
    shells->shift = 52 - bits;
    shells->first = (bits_of(hs_larger(shells->low[k], 0.0)) >> shells->shift) - 1;
    shells->last = (bits_of(cutoff) >> shells->shift) - shells->first;
    if (shells->last >= MOST_CELLS) {
        shells->first += shells->last - (MOST_CELLS - 1);
        shells->last = MOST_CELLS - 1;
    }
    for (k++; k < n; k++) {
        const int64_t at = bits_of(shells->low[k]) >> shells->shift;
        const int64_t before = bits_of(shells->high[k - 1]) >> shells->shift;
        shared += shells->low[k] > shells->high[k - 1] && (at <= before || at <= shells->first);
    }
    return shared;
}

static void
fill_cells(const hs_shells *shells)
{
    int64_t below = 0, reached = 0; /* bands that end before the cell, or begin before its end */
    for (int64_t c = 0; c <= shells->last; c++) {
        const double least = c == 0 ? 0.0 : least_of(shells->first + c, shells->shift);
        const double end = least_of(shells->first + c + 1, shells->shift);
        while (below < shells->n && shells->high[below] < least) {
            below++;
        }
        while (reached < shells->n && (c == shells->last || shells->low[reached] < end)) {
            reached++;
        }
        hs_shell_cell *cell = &shells->cells[c];
        *cell = (hs_shell_cell){.low = INT64_MAX, .high = INT64_MAX, .below = (int32_t)below};
        if (reached - below == 1) {
            cell->low = bits_of(hs_larger(shells->low[below], 0.0));
            cell->high = bits_of(shells->high[below]);
        } else if (reached > below) {
            cell->low = 0; /* all of them are looked at again */
        }
    }
}

/* The edges of the options, in both units, and their bands. */
static void
set_edges(const hs_scene *scene, const hs_options *options, hs_shells *shells)
{
    for (int64_t k = 0; k < shells->n; k++) {
        const double edge = options->shells[k], width = edge * BAND + LEAST_BAND;
        shells->edge[k] = edge;
        shells->at[k] = scene->extreme ? edge : hs_scale_apply(scene->scale, edge);
        shells->low[k] = edge - width;
        shells->high[k] = edge + width;
    }
}

hs_status
hs_shells_open(hs_account *account, const hs_scene *scene, const hs_options *options,
               hs_shells *shells)
{
    const int64_t n = options->want & HS_WANT_SHELL ? options->n_shells - 1 : 0;
    *shells = (hs_shells){.inclusive = options->inclusive};
    if (n == 0) {
        return HS_OK;
    }
    shells->edge = hs_alloc(account, HS_FOR_CANDIDATES, 4 * n, sizeof(double));
    if (shells->edge == NULL) {
        return HS_ERR_MEMORY;
    }
    shells->n = n;
    shells->at = shells->edge + n;
    shells->low = shells->at + n;
    shells->high = shells->low + n;
    set_edges(scene, options, shells);
    for (size_t b = 0; b < sizeof cell_bits / sizeof *cell_bits; b++) {
        if (set_cells(options->cutoff, cell_bits[b], shells) == 0) {
            break;
        }
    }
    shells->cells = hs_alloc(account, HS_FOR_CANDIDATES, shells->last + 1, sizeof(hs_shell_cell));
    if (shells->cells == NULL) {
        hs_shells_free(account, shells);
        return HS_ERR_MEMORY;
    }
    fill_cells(shells);
    return HS_OK;
}

void
hs_shells_free(hs_account *account, hs_shells *shells)
{
    hs_free(account, shells->cells);
    hs_free(account, shells->edge);
    *shells = (hs_shells){.n = 0};
}

bool
hs_shells_find(const hs_shells *shells, const double *distance, int32_t n, int32_t *shell)
{
    const hs_shell_cell *cells = shells->cells;
    const int64_t        first = shells->first;
    const int            shift = shells->shift;
    int64_t              sure = -1;
    if (shells->n == 0) {
        memset(shell, 0, (size_t)n * sizeof *shell);
        return false;
    }
    for (int32_t h = 0; h < n; h++) {
        const int64_t        bits = bits_of(distance[h]), at = (bits >> shift) - first;
        const hs_shell_cell *cell = &cells[at < 0 ? 0 : at];
        /* Differences of these do not overflow; their sign bits count. */
        const int64_t above = cell->high - bits;
        shell[h] = cell->below + (int32_t)((uint64_t)above >> 63);
        sure &= above | (bits - cell->low);
    }
    return sure >= 0;
}

void
hs_shells_range(const hs_shells *shells, double distance, int32_t *low, int32_t *high)
{
    const int32_t n = (int32_t)shells->n;
    while (*low < n && shells->high[*low] < distance) {
        ++*low;
    }
    *high = *low;
    while (*high < n && shells->low[*high] <= distance) {
        ++*high;
    }
}

double
hs_shells_keep(const hs_shells *shells, int64_t k, double distance)
{
    if (k > 0) {
        const double below = shells->edge[k - 1];
        distance = hs_larger(distance, shells->inclusive ? nextafter(below, INFINITY) : below);
    }
    return k < shells->n ? hs_keep_within(distance, shells->edge[k], shells->inclusive) : distance;
}
