/* SPDX-License-Identifier: BSD-3-Clause */
/* record_measures.c: a batch of hits at a time, looked up, measured by the batch kernel, brought to
 * the caller's unit. */
#include "record_measures.h"

#include "measures.h"
#include "../search/limits.h"

#include <string.h>

/* Hits of the batch that is being written. */
typedef struct batch_part {
    int32_t first;           /* its first hit */
    int32_t point[HS_BATCH]; /* number of the point whose hit each one is */
} batch_part;

/* The first nonzero component of S is negative. */
static bool
is_backward(const hs_trace *trace, int32_t e)
{
    const int m = trace->search->scene.lattice.n_periodic;
    for (int l = 0; l < m; l++) {
        const int64_t shift = trace->of.is_narrow ? trace->shift[l][e] : trace->given[l][e];
        if (shift != 0) {
            return shift < 0;
        }
    }
    return false;
}

/* 1, or -1 for pairs of a half list that are listed the other way round. */
static void
find_signs(const hs_trace *trace, const int32_t *point, const int32_t *id, double *sign)
{
    int32_t any_own = 0;
    for (int32_t e = 0; e < trace->n; e++) {
        sign[e] = id[e] < point[e] ? -1.0 : 1.0;
        any_own |= id[e] == point[e];
    }
    for (int32_t e = 0; any_own && e < trace->n; e++) {
        if (id[e] == point[e] && is_backward(trace, e)) {
            sign[e] = -1.0;
        }
    }
}

/* d and D of the batch to the recorder's arrays, in the unit of the metric. */
static void
measure(hs_recorder *recorder, hs_trace *trace)
{
    const hs_search *search = trace->search;
    const hs_batch   batch = hs_trace_batch(trace);
    int64_t *const  *shift = search->bins.keeps_originals ? trace->given : trace->image;
    double *const   *vector = recorder->columns & HS_WANT_VECTOR ? recorder->vector : NULL;
    hs_measure_pairs(search->call->kernel, &search->scene.metric, &batch,
                     trace->is_shifted ? shift : NULL, trace->is_wide, recorder->distance, vector);
}

/* Distances of the batch, none beyond the limit of its pair, or what that is rounded to. */
static void
keep_within_limits(const hs_scanner *scanner, double *distance, hs_scale unscale)
{
    for (int32_t e = 0; e < scanner->trace.n; e++) {
        const hs_dw limit = hs_limit_of_pair(scanner, e);
        distance[e] = hs_keep_within(distance[e], hs_scale_apply(unscale, limit.hi),
                                     scanner->options.inclusive || limit.lo > 0.0);
    }
}

static void
put_distances(hs_recorder *recorder, const hs_scanner *scanner, int32_t first)
{
    const hs_search  *search = scanner->search;
    const hs_options *options = &search->call->options;
    const int32_t     n = scanner->trace.n;
    const hs_scale    unscale = hs_measures_unscale(&search->scene);
    double           *to = hs_recorder_distances(recorder);
    hs_restore_distances(recorder->distance, n, unscale);
    if (options->precision == HS_EXACT && search->limits != NULL &&
        search->limits->supports == NULL) {
        keep_within_limits(scanner, recorder->distance, unscale);
    } else if (options->precision == HS_EXACT) {
        hs_keep_all_within(recorder->distance, n, options->cutoff, options->inclusive);
    }
    memcpy(to + first, recorder->distance, (size_t)n * sizeof *to);
}

static void
put_vectors(const hs_recorder *recorder, const hs_search *search, const double *sign, int32_t first,
            int32_t n)
{
    const int d = recorder->output->ndim;
    double   *to = hs_output_next(recorder->output, HS_WANT_VECTOR);
    hs_restore_vectors(to + (int64_t)first * d, recorder->vector, sign, n, d,
                       hs_measures_unscale(&search->scene));
}

/* Shifts that only sort the images of one pair may leave out what these images share: the turns by
 * which i and j were wrapped, which can be too many for int32. Returns the first pair whose shift
 * does not fit, or their number. */
static int32_t
find_keys(const hs_trace *trace, int64_t keys[][HS_BATCH])
{
    const int m = trace->search->scene.lattice.n_periodic;
    for (int32_t e = 0; e < trace->n; e++) {
        int64_t image[HS_MAX_DIM], key[HS_MAX_DIM];
        for (int r = 0; r < m; r++) {
            image[r] = trace->image[r][e];
        }
        if (!hs_lattice_shift(&trace->search->scene.lattice, image, key)) {
            return e;
        }
        for (int l = 0; l < m; l++) {
            keys[l][e] = key[l];
        }
    }
    return trace->n;
}

/* S over all box vectors, zero on open ones, when all are few. */
static void
put_narrow(const hs_trace *trace, const double *sign, int32_t *to)
{
    const hs_lattice *lattice = &trace->search->scene.lattice;
    const int         d = lattice->ndim;
    int32_t           flip[HS_BATCH]; /* 0, or -1 to negate: (x ^ -1) - -1 */
    for (int32_t e = 0; e < trace->n; e++) {
        flip[e] = -(sign[e] < 0.0);
    }
    if (d == 3 && lattice->n_periodic == 3) { /* most scenes: one pair after the other */
        const int32_t *x = trace->shift[0], *y = trace->shift[1], *z = trace->shift[2];
        for (int32_t e = 0; e < trace->n; e++, to += 3) {
            to[lattice->vector_of_row[0]] = (x[e] ^ flip[e]) - flip[e];
            to[lattice->vector_of_row[1]] = (y[e] ^ flip[e]) - flip[e];
            to[lattice->vector_of_row[2]] = (z[e] ^ flip[e]) - flip[e];
        }
        return;
    }
    for (int l = 0; l < lattice->n_periodic; l++) {
        const int32_t *shift = trace->shift[l];
        int32_t       *column = to + lattice->vector_of_row[l];
        for (int32_t e = 0; e < trace->n; e++) {
            column[(int64_t)e * d] = (shift[e] ^ flip[e]) - flip[e];
        }
    }
}

/* S over all box vectors, zero on open ones. Returns the first pair whose S does not fit int32, or
 * their number. */
static int32_t
put_shifts(const hs_recorder *recorder, const hs_trace *trace, const double *sign, int32_t first)
{
    const hs_lattice *lattice = &trace->search->scene.lattice;
    const int         d = lattice->ndim, m = lattice->n_periodic;
    const bool        keys_only = !(trace->search->call->options.want & HS_WANT_SHIFT);
    int64_t           keys[HS_MAX_DIM][HS_BATCH];
    int32_t *to = (int32_t *)hs_output_next(recorder->output, HS_WANT_SHIFT) + (int64_t)first * d;
    int32_t  fitting = trace->n;
    if (m < d) {
        memset(to, 0, (size_t)trace->n * (size_t)d * sizeof *to);
    }
    if (trace->of.is_narrow) { /* what is left out is zero, or common to all images */
        put_narrow(trace, sign, to);
        return fitting;
    }
    if (keys_only) {
        fitting = find_keys(trace, keys);
    }
    for (int l = 0; l < m; l++) {
        const int64_t *shifts = keys_only ? keys[l] : trace->given[l];
        int32_t       *column = to + lattice->vector_of_row[l];
        for (int32_t e = 0; e < fitting; e++) {
            const int64_t value = sign[e] < 0.0 ? -shifts[e] : shifts[e];
            column[(int64_t)e * d] = (int32_t)value;
            if (value < INT32_MIN || value > INT32_MAX) {
                fitting = e;
            }
        }
    }
    return fitting;
}

/* Writes the batch. */
static hs_status
put_batch(hs_recorder *recorder, hs_scanner *scanner, const batch_part *part)
{
    hs_trace        *trace = &scanner->trace;
    const hs_search *search = scanner->search;
    const bool       measured = recorder->columns & HS_MEASURED;
    double           sign[HS_BATCH];
    const hs_status  status = hs_trace_look_up(&scanner->trace, measured, &scanner->failed_point);
    if (status != HS_OK) {
        return status;
    }
    if (!search->is_half) {
        for (int32_t e = 0; e < trace->n; e++) {
            sign[e] = 1.0;
        }
    } else if (recorder->columns & (HS_WANT_VECTOR | HS_WANT_SHIFT)) {
        find_signs(trace, part->point, recorder->ids + part->first, sign);
    }
    if (measured) {
        measure(recorder, trace);
    }
    if (recorder->columns & (HS_WANT_DISTANCE | HS_WANT_SHELL)) {
        put_distances(recorder, scanner, part->first);
    }
    if (recorder->columns & HS_WANT_VECTOR) {
        put_vectors(recorder, search, sign, part->first, trace->n);
    }
    if (recorder->columns & HS_WANT_SHIFT) {
        const int32_t fitting = put_shifts(recorder, trace, sign, part->first);
        if (fitting < trace->n) {
            scanner->failed_point = part->point[fitting];
            return HS_ERR_SHIFT_RANGE;
        }
    }
    return HS_OK;
}

hs_status
hs_put_measures(hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_trace  *trace = &scanner->trace;
    batch_part part = {.first = 0};
    hs_trace_clear(trace);
    for (int32_t t = 0, h = 0; t < hits->n; t++) {
        while (h < hits->end[t]) {
            const int32_t taken = hs_trace_add(trace, first + t, hits->label + h, hits->end[t] - h);
            for (int32_t e = trace->n - taken; e < trace->n; e++) {
                part.point[e] = hits->point[t];
            }
            h += taken;
            if (trace->n == HS_BATCH) {
                const hs_status status = put_batch(recorder, scanner, &part);
                if (status != HS_OK) {
                    return status;
                }
                part.first = h;
                hs_trace_clear(trace);
            }
        }
    }
    return trace->n > 0 ? put_batch(recorder, scanner, &part) : HS_OK;
}
