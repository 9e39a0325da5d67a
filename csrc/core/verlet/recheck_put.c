/* SPDX-License-Identifier: BSD-3-Clause */
/* recheck_put.c: the hits of a slab as pairs: i, j and S. See recheck.h. */
#include "recheck.h"

#include <string.h>

/* S over all box vectors, zero on open ones; where only sorting needs it the images alone, which
 * are in the same order and always fit. */
static void
put_shifts(const hs_refilter *refilter, hs_sifted *slab)
{
    const hs_listing *listing = &refilter->list->listing;
    const bool        keys_only = !(refilter->search->options.want & HS_WANT_SHIFT);
    const int         d = refilter->d, m = refilter->m;
    int32_t          *to = hs_refilter_column(refilter, HS_WANT_SHIFT, slab->at);
    const bool        plain = slab->first < listing->n_plain;
    memset(to, 0, (size_t)slab->n_hits * (size_t)d * sizeof *to);
    if (plain && (keys_only || refilter->counts == NULL)) {
        return;
    }
    for (int32_t h = 0; h < slab->n_hits; h++) {
        const int64_t  e = slab->first + slab->hits[h];
        const int32_t *image =
            plain ? NULL : listing->images.of + (int64_t)listing->code[e - listing->n_plain] * m;
        int64_t shift[HS_MAX_DIM];
        if (!keys_only) {
            hs_refilter_shift(refilter, e, shift);
        }
        for (int r = 0; r < m; r++) {
            const int64_t value = keys_only ? image[r] : shift[r];
            if (value < INT32_MIN || value > INT32_MAX) {
                slab->status = HS_ERR_SHIFT_RANGE;
                slab->failed_point = listing->order[listing->i[e]];
                return;
            }
            to[(int64_t)h * d + refilter->vector_of_row[r]] = (int32_t)value;
        }
    }
}

/* The caller's number of each hit's point, to every `step`-th index. */
HS_ALWAYS_INLINE void
put_numbers(const int32_t *places, const int32_t *order, const hs_sifted *slab, int index_bytes,
            const int step, void *to)
{
    const uint16_t *hits = slab->hits;
    if (to == NULL) {
        return;
    }
    if (index_bytes == 8) {
        int64_t *wide = to;
        for (int32_t h = 0; h < slab->n_hits; h++) {
            wide[(int64_t)h * step] = order[places[hits[h]]];
        }
    } else {
        int32_t *narrow = to;
        for (int32_t h = 0; h < slab->n_hits; h++) {
            narrow[(int64_t)h * step] = order[places[hits[h]]];
        }
    }
}

void
hs_refilter_put(const hs_refilter *refilter, hs_sifted *slab)
{
    const hs_listing *listing = &refilter->list->listing;
    const int         bytes = refilter->output->index_bytes;
    const int32_t    *order = listing->order;
    const int32_t    *i = listing->i + slab->first, *j = listing->j + slab->first;
    char             *both = hs_refilter_column(refilter, HS_WANT_BOTH, slab->at);
    put_numbers(i, order, slab, bytes, 1, hs_refilter_column(refilter, HS_WANT_I, slab->at));
    put_numbers(j, order, slab, bytes, 1, hs_refilter_column(refilter, HS_WANT_J, slab->at));
    put_numbers(i, order, slab, bytes, 2, both);
    put_numbers(j, order, slab, bytes, 2, both == NULL ? NULL : both + bytes);
    if (refilter->output->columns & HS_WANT_SHIFT) {
        put_shifts(refilter, slab);
    }
    if (refilter->measures && slab->n_hits > 0) {
        hs_refilter_measure(refilter, slab);
    }
}
