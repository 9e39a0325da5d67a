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

/* Takes note of how large the coordinates of a point are that is stored now. */
static void
raise_bounds(hs_dynamic *list, const hs_placed *placed)
{
    for (int k = 0; k < list->lattice.ndim; k++) {
        list->largest = hs_larger(fabs(placed->x[k]), list->largest);
    }
    list->magnitude = hs_larger(placed->magnitude, list->magnitude);
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
        raise_bounds(list, placed);
    }
}
