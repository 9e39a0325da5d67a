/* SPDX-License-Identifier: BSD-3-Clause */
/* place_point.c: positions made ready, for the number of dimensions that a list has. */
#include "place_point.h"

hs_status
hs_dynamic_place(const hs_dynamic *list, const double *given, hs_placed *placed,
                 hs_failure *failure)
{
    switch (list->lattice.ndim) {
    case 2: return hs_dynamic_place_in(list, given, placed, failure, 2);
    case 3: return hs_dynamic_place_in(list, given, placed, failure, 3);
    default: return hs_dynamic_place_in(list, given, placed, failure, list->lattice.ndim);
    }
}

/* The largest sum of absolute terms that a coordinate is wrapped by, of those that the box moves:
 * others are what was given. */
static double
terms_of_wrapping(const hs_dynamic *list, const hs_placed *placed)
{
    const hs_lattice *lattice = &list->lattice;
    int64_t           given_turns[HS_MAX_DIM];
    double            largest = 0.0;
    (void)hs_lattice_shift(lattice, placed->turns, given_turns); /* as when it was wrapped */
    for (int c = 0; c < lattice->ndim; c++) {
        double terms = list->moves[c] ? fabs(placed->given[c]) : 0.0;
        for (int l = 0; l < lattice->n_periodic; l++) {
            terms += fabs((double)given_turns[l] * lattice->given[l][c]);
        }
        largest = hs_larger(terms, largest);
    }
    return largest;
}

bool
hs_dynamic_is_known(const hs_dynamic *list, hs_placed *placed)
{
    const hs_lattice *lattice = &list->lattice;
    bool              known = true;
    if (placed->magnitude > 0x1p-50 * list->most_terms) {
        placed->magnitude = terms_of_wrapping(list, placed);
        known = placed->magnitude <= list->most_terms;
    }
    for (int k = 0; k < lattice->ndim; k++) {
        placed->terms[k] = hs_axis_terms(lattice, placed->x, k);
        known = known && placed->terms[k] < list->axes.axis[k].farthest;
    }
    return known;
}

/* In line: a call of memcpy for two or three numbers takes longer than they do. */
HS_ALWAYS_INLINE void
copy_numbers(double *to, const double *from, int n)
{
    for (int k = 0; k < n; k++) {
        to[k] = from[k];
    }
}

void
hs_dynamic_write(hs_dynamic *list, uint32_t place, const hs_placed *placed)
{
    const int     d = list->lattice.ndim;
    double *const x = hs_entry_at(&list->entries, place);
    if (placed == NULL) {
        for (int k = 0; k < d; k++) {
            x[k] = NAN;
        }
        return;
    }
    copy_numbers(x, placed->x, d);
    if (list->entries.keeps_given) {
        copy_numbers(hs_entry_given(&list->entries, place), placed->given, d);
    }
    if (!list->lattice.aligned) {
        list->magnitude = hs_larger(placed->magnitude, list->magnitude);
    }
}
