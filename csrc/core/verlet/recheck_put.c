/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * recheck_put.c: the hits of a slab as pairs: i and j by the kernel that writes those of a search,
 * S, and what recheck_measure.c measures. The kernel writes a little beyond the last pair. Where
 * that is none of ours, in arrays of the caller, it writes to the slab, and the pairs are copied.
 */
#include "recheck.h"

#include <string.h>

/* The hits as point numbers. */
static hs_hits
hits_by_number(const hs_recheck *recheck, hs_sifted *slab)
{
    const hs_listing *listing = &recheck->list->listing;
    const hs_hits     hits = {.n = slab->n_bundles,
                              .point = slab->point,
                              .end = slab->hits_end,
                              .label = recheck->numbers ? slab->hits : slab->number};
    for (int32_t b = 0; !recheck->numbers && b < slab->n_bundles; b++) {
        slab->point[b] = listing->order[slab->bundles[b].point];
    }
    for (int32_t h = 0; !recheck->numbers && h < slab->n_hits; h++) {
        slab->number[h] = listing->order[slab->hits[h]];
    }
    return hits;
}

/* n numbers to every `step`-th index from `to` on. */
HS_ALWAYS_INLINE void
copy_numbers(const int32_t *numbers, int32_t n, int index_bytes, const int step, void *to)
{
    if (to == NULL) {
        return;
    }
    if (index_bytes == 4 && step == 1) {
        memcpy(to, numbers, (size_t)n * sizeof *numbers);
    } else if (index_bytes == 4) {
        for (int32_t h = 0; h < n; h++) {
            ((int32_t *)to)[(int64_t)h * step] = numbers[h];
        }
    } else {
        for (int32_t h = 0; h < n; h++) {
            ((int64_t *)to)[(int64_t)h * step] = numbers[h];
        }
    }
}

static void
put_indices(const hs_recheck *recheck, hs_sifted *slab)
{
    const hs_kernel *kernel = recheck->call->kernel;
    const hs_output *output = recheck->output;
    const hs_hits    hits = hits_by_number(recheck, slab);
    const int        bytes = output->index_bytes;
    char            *both = hs_recheck_column(recheck, HS_WANT_BOTH, slab->at);
    void            *i = hs_recheck_column(recheck, HS_WANT_I, slab->at);
    void            *j = hs_recheck_column(recheck, HS_WANT_J, slab->at);
    if (both == NULL && i == NULL && j == NULL) {
        return;
    }
    if (both == NULL && !output->fixed) {
        (bytes == 8 ? kernel->emit_int64 : kernel->emit_int32)(&hits, i, j);
        return;
    }
    kernel->emit_int32(&hits, slab->i, slab->j);
    copy_numbers(slab->i, slab->n_hits, bytes, 1, i);
    copy_numbers(slab->j, slab->n_hits, bytes, 1, j);
    copy_numbers(slab->i, slab->n_hits, bytes, 2, both);
    copy_numbers(slab->j, slab->n_hits, bytes, 2, both == NULL ? NULL : both + bytes);
}

/* Where the hits of a bundle begin. */
HS_ALWAYS_INLINE int32_t
begin_of(const hs_sifted *slab, int32_t t)
{
    return t > 0 ? slab->hits_end[t - 1] : 0;
}

/* S of the hits of one bundle; returns whether a number does not fit. counts: NULL: as if no point
 * had any. */
HS_ALWAYS_INLINE bool
put_of_bundle(const hs_recheck *recheck, const hs_sifted *slab, int32_t t, const int64_t *counts,
              const int d, const int m, int32_t *to)
{
    const hs_listing *listing = &recheck->list->listing;
    const int32_t    *order = listing->order;
    const int32_t    *image = hs_recheck_image(recheck, slab, t);
    const int64_t     a = slab->bundles[t].point;
    const int32_t     number = order[a];
    uint64_t          of_a[HS_MAX_DIM] = {0};
    int64_t           beyond = 0;
    for (int r = 0; r < m; r++) { /* modulo 2^64: exact, for the sum fits */
        of_a[r] = image == NULL ? 0 : (uint64_t)(int64_t)image[r];
        of_a[r] += counts == NULL ? 0 : (uint64_t)counts[a * m + r];
    }
    for (int32_t h = begin_of(slab, t); h < slab->hits_end[t]; h++) {
        const int64_t  b = slab->hits[h];
        const uint64_t turn = number > order[b] ? UINT64_MAX : 0; /* -x is (x ^ ~0) + 1 */
        for (int r = 0; r < m; r++) {
            const uint64_t shift = of_a[r] - (counts == NULL ? 0 : (uint64_t)counts[b * m + r]);
            const int64_t  value = (int64_t)((shift ^ turn) - turn);
            beyond |= value ^ (int32_t)value;
            to[(int64_t)h * d + recheck->vector_of_row[r]] = (int32_t)value;
        }
    }
    return beyond != 0;
}

/* The first point of the first pair of the bundle whose S does not fit; there is one. */
static int64_t
first_beyond(const hs_recheck *recheck, const hs_sifted *slab, int32_t t)
{
    const hs_listing *listing = &recheck->list->listing;
    const int64_t     a = slab->bundles[t].point;
    for (int32_t h = begin_of(slab, t);; h++) {
        HS_ASSERT(h < slab->hits_end[t]);
        const int64_t b = slab->hits[h];
        const bool    turned = listing->order[a] > listing->order[b];
        int64_t       shift[HS_MAX_DIM];
        hs_recheck_shift(recheck, a, b, hs_recheck_image(recheck, slab, t), shift);
        for (int r = 0; r < recheck->m; r++) {
            const int64_t value = turned ? (int64_t)(0 - (uint64_t)shift[r]) : shift[r];
            if (value != (int32_t)value) {
                return listing->order[turned ? b : a];
            }
        }
    }
}

/* S, zero over open box vectors; where only sorting needs it, the images alone, which sort as S
 * does and always fit. */
static void
put_shifts(const hs_recheck *recheck, hs_sifted *slab)
{
    const bool     images_only = !(recheck->call->options.want & HS_WANT_SHIFT);
    const int64_t *counts = images_only ? NULL : recheck->counts;
    const bool     any = hs_sifted_has_images(recheck, slab) || counts != NULL;
    const int      d = recheck->d, m = recheck->m;
    int32_t       *to = hs_recheck_column(recheck, HS_WANT_SHIFT, slab->at);
    if (m < d || !any) {
        memset(to, 0, (size_t)slab->n_hits * (size_t)d * sizeof *to);
    }
    for (int32_t t = 0; any && t < slab->n_bundles; t++) {
        const bool beyond = d == 3 && m == 3 ? put_of_bundle(recheck, slab, t, counts, 3, 3, to)
                                             : put_of_bundle(recheck, slab, t, counts, d, m, to);
        if (beyond) {
            slab->status = HS_ERR_SHIFT_RANGE;
            slab->failed_point = first_beyond(recheck, slab, t);
            return;
        }
    }
}

void
hs_recheck_put(const hs_recheck *recheck, hs_sifted *slab)
{
    if (slab->n_hits == 0) {
        return;
    }
    if (!(recheck->writes && hs_recheck_write(recheck, slab))) {
        put_indices(recheck, slab);
        if (recheck->measures) {
            hs_recheck_measure(recheck, slab);
        }
    }
    if (recheck->output->columns & HS_WANT_SHIFT) {
        put_shifts(recheck, slab);
    }
}
