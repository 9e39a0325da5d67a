/* SPDX-License-Identifier: BSD-3-Clause */
/* pair_batch.c: each batch copies from the records of its candidates, axis by axis, as the batch
 * kernels want them, or for few pairs from the points themselves. */
#include "pair_batch.h"

#include "../memory/parts.h"

#include <string.h>

/* Integers up to here are float64 numbers, and what the batch kernels take. */
#define WIDEST_SHIFT (INT64_C(1) << 53)

/* One pair of so many candidates is looked up by itself, more by the records of the whole block. */
#define FEW_OF_BLOCK 8

/* n arrays of `length` entries. */
static void
add_arrays(hs_parts *parts, int n, int64_t length, size_t size, void **arrays)
{
    for (int k = 0; k < n; k++) {
        hs_parts_add(parts, &arrays[k], length, size);
    }
}

static bool
allocate(hs_account *account, hs_trace *trace)
{
    const int     d = trace->search->scene.ndim, m = trace->search->scene.lattice.n_periodic;
    const bool    as_given = trace->search->bins.keeps_originals, narrow = trace->of.is_narrow;
    const int     m_given = trace->of.needs_given && (as_given || !narrow) ? m : 0;
    const int     m_narrow = trace->of.needs_given && narrow ? m : 0;
    const int64_t batch = HS_BATCH + HS_BATCH_PADDING;
    hs_parts      parts;
    hs_parts_begin(&parts);
    add_arrays(&parts, 1, HS_BATCH, sizeof(int32_t), (void **)&trace->place);
    add_arrays(&parts, 1, HS_BATCH, sizeof(int32_t), (void **)&trace->si);
    add_arrays(&parts, d, batch, sizeof(double), (void **)trace->p);
    add_arrays(&parts, d, batch, sizeof(double), (void **)trace->q);
    add_arrays(&parts, m, batch, sizeof(double), (void **)trace->times);
    add_arrays(&parts, m, HS_BATCH, sizeof(int64_t), (void **)trace->image);
    add_arrays(&parts, m_given, HS_BATCH, sizeof(int64_t), (void **)trace->given);
    add_arrays(&parts, m_narrow, HS_BATCH, sizeof(int32_t), (void **)trace->shift);
    trace->memory = hs_parts_alloc(account, HS_FOR_CANDIDATES, &parts);
    return trace->memory != NULL;
}

hs_status
hs_trace_init(const hs_search *search, const hs_block *block, const hs_options *polls,
              bool needs_given, hs_trace *trace)
{
    hs_account *account = &search->call->account;
    trace->search = search;
    trace->memory = NULL;
    trace->n_rows = search->scene.lattice.n_periodic;
    trace->as_given = search->bins.keeps_originals;
    trace->is_plain = hs_has_plain_shifts(&search->scene.lattice);
    trace->has_zeros = false;
    hs_trace_clear(trace);
    hs_status status = hs_records_init(search, block, polls, needs_given, &trace->of);
    if (status == HS_OK && !allocate(account, trace)) {
        status = HS_ERR_MEMORY;
    }
    if (status != HS_OK) {
        hs_trace_free(account, trace);
    }
    return status;
}

bool
hs_trace_renew(bool needs_given, hs_trace *trace)
{
    const hs_search *search = trace->search;
    if (trace->n_rows != search->scene.lattice.n_periodic ||
        trace->as_given != search->bins.keeps_originals ||
        trace->of.needs_given != (needs_given || trace->as_given) ||
        trace->of.is_narrow != hs_has_narrow_shifts(search)) {
        return false;
    }
    trace->is_plain = hs_has_plain_shifts(&search->scene.lattice);
    hs_trace_clear(trace);
    return true;
}

void
hs_trace_free(hs_account *account, hs_trace *trace)
{
    hs_free(account, trace->memory);
    trace->memory = NULL;
    hs_records_free(account, &trace->of);
}

/* Rows of B that point si was wrapped by; 0 where that is known to cancel or not needed. */
HS_ALWAYS_INLINE int64_t
turns_of(const hs_bins *bins, int r, int64_t si)
{
    return bins->turns.known ? hs_turns_get(&bins->turns, r, si) : 0;
}

int32_t
hs_trace_add(hs_trace *trace, int32_t si, const int32_t *places, int32_t n)
{
    const int32_t room = HS_BATCH - trace->n;
    int32_t      *place = trace->place + trace->n, *of = trace->si + trace->n;
    n = n < room ? n : room;
    for (int32_t e = 0; e < n; e++) {
        place[e] = places[e];
        of[e] = si;
    }
    trace->n += n;
    return n;
}

/* The run that a place is in. The number of steps depends on that of runs alone: branches on where
 * the place is would be guessed, half of them wrongly. */
static const hs_run *
run_of(const hs_block *block, int32_t place)
{
    const hs_run *run = block->runs;
    for (int32_t n = block->n_runs, half; n > 1;
         n -= half) { /* it is one of run[0] to run[n - 1] */
        half = n / 2;
        run += run[half].at <= place ? half : 0;
    }
    return run;
}

/* What the metric measures between, and its shifts, without records: they are of X, over B. Where
 * the block has no image, `image` and `times` are left alone, and not read later. */
static void
look_up_few(hs_trace *trace)
{
    const hs_block *block = trace->of.block;
    const hs_bins  *bins = &trace->search->bins, *asking = hs_search_asking(trace->search);
    for (int k = 0; k < bins->ndim; k++) {
        for (int32_t e = 0; e < trace->n; e++) {
            trace->p[k][e] = asking->x[k][trace->si[e]];
            trace->q[k][e] = bins->x[k][block->number[trace->place[e]]];
        }
    }
    int32_t    any = 0;
    const bool images = hs_records_has_images(&trace->of);
    for (int32_t e = 0; images && e < trace->n; e++) {
        const hs_run *run = run_of(block, trace->place[e]);
        for (int r = 0; r < bins->n_periodic; r++) {
            trace->image[r][e] = run->image[r];
            trace->times[r][e] = (double)run->image[r];
            any |= run->image[r];
        }
    }
    trace->is_shifted = any != 0;
    trace->has_zeros = false;
}

static void
look_up_points(hs_trace *trace)
{
    const hs_bins *bins = hs_search_asking(trace->search);
    const int32_t *place = trace->place, *si = trace->si;
    const int      width = trace->of.width;
    const int32_t  n = trace->n;
    for (int k = 0; k < bins->ndim; k++) {
        const double *of_p = bins->keeps_originals ? bins->originals[k] : bins->x[k];
        const double *of_q = trace->of.q + k;
        double       *p = trace->p[k], *q = trace->q[k];
        for (int32_t e = 0; e < n; e++) {
            p[e] = of_p[si[e]];
            q[e] = of_q[(int64_t)place[e] * width];
        }
    }
}

/* S = image + turns_i - turns_j; of points as given also the metric's shift. */
static void
look_up_narrow(hs_trace *trace)
{
    const bool      as_given = trace->search->bins.keeps_originals;
    const hs_turns *turns = &hs_search_asking(trace->search)->turns;
    const int32_t  *place = trace->place, *si = trace->si;
    const int32_t  *few = trace->search->bins.turns.known ? trace->of.few
                          : trace->of.has_images          ? trace->of.image
                                                          : NULL;
    const int32_t   n = trace->n, width = trace->of.width;
    int32_t         any = 0;
    for (int r = 0; r < trace->search->bins.n_periodic; r++) {
        int32_t *to = trace->shift[r];
        for (int32_t e = 0; e < n; e++) {
            to[e] = few != NULL ? few[(int64_t)place[e] * width + r] : 0;
        }
        for (int32_t e = 0; turns->known && e < n; e++) {
            to[e] += (int32_t)hs_turns_get(turns, r, si[e]);
        }
        for (int32_t e = 0; as_given && e < n; e++) {
            trace->given[r][e] = to[e];
            trace->times[r][e] = (double)to[e];
            any |= to[e];
        }
    }
    trace->is_shifted = trace->is_shifted || any != 0;
}

/* S = image + turns_i - turns_j over B, then over the box vectors as given. Without turns they are
 * all known to cancel or not to be needed. Returns the first pair whose S passes its range, or
 * their number. */
static int32_t
look_up_given(hs_trace *trace)
{
    const hs_bins *asking = hs_search_asking(trace->search);
    const int      m = trace->search->bins.n_periodic;
    for (int r = 0; r < m; r++) {
        const int64_t *turned = trace->of.turned + r;
        int64_t       *to = trace->given[r];
        for (int32_t e = 0; e < trace->n; e++) {
            to[e] = turned[(int64_t)trace->place[e] * trace->of.width] +
                    turns_of(asking, r, trace->si[e]);
        }
    }
    for (int32_t e = 0; !trace->is_plain && e < trace->n; e++) {
        int64_t reduced[HS_MAX_DIM], given[HS_MAX_DIM];
        for (int r = 0; r < m; r++) {
            reduced[r] = trace->given[r][e];
        }
        if (!hs_lattice_shift(&trace->search->scene.lattice, reduced, given)) {
            return e;
        }
        for (int r = 0; r < m; r++) {
            trace->given[r][e] = given[r];
        }
    }
    return trace->n;
}

/* Shifts over B, the metric's where it measures between X. Where the block has none, they are
 * zeroed once and left alone; how many times the metric shifts is not read then. */
static void
look_up_images(hs_trace *trace)
{
    const bool zero = !trace->of.has_images;
    int32_t    any = 0;
    if (zero && trace->has_zeros) {
        return;
    }
    for (int r = 0; r < trace->search->bins.n_periodic; r++) {
        const int32_t *from = trace->of.image + r;
        if (zero) {
            memset(trace->image[r], 0, HS_BATCH * sizeof(int64_t));
        }
        for (int32_t e = 0; e < trace->n && !zero; e++) {
            const int32_t image = from[(int64_t)trace->place[e] * trace->of.width];
            trace->image[r][e] = image;
            trace->times[r][e] = (double)image;
            any |= image;
        }
    }
    trace->has_zeros = zero;
    trace->is_shifted = any != 0 && !trace->search->bins.keeps_originals;
}

/* The metric's shift of points as given, over the box vectors as given. */
static void
look_up_times(hs_trace *trace)
{
    int64_t any = 0, wide = 0;
    for (int r = 0; r < trace->search->bins.n_periodic; r++) {
        const int64_t *from = trace->given[r];
        for (int32_t e = 0; e < trace->n; e++) {
            trace->times[r][e] = (double)from[e];
            any |= from[e];
            wide |= from[e] > WIDEST_SHIFT || from[e] < -WIDEST_SHIFT;
        }
    }
    trace->is_shifted = any != 0;
    trace->is_wide = wide != 0;
}

hs_status
hs_trace_look_up(hs_trace *trace, bool metric, int64_t *failed_point)
{
    const hs_bins *bins = hs_search_asking(trace->search);
    metric = metric ||
             !trace->of.is_narrow; /* shifts of the points as given are the metric's too */
    if (!trace->of.needs_given && !trace->of.has_metric &&
        trace->n <= trace->of.block->n / FEW_OF_BLOCK) {
        look_up_few(trace);
        return HS_OK;
    }
    if (hs_records_load(&trace->of, metric) != HS_OK) {
        return HS_ERR_INTERRUPTED;
    }
    if (metric) {
        look_up_points(trace);
        look_up_images(trace);
    }
    if (trace->of.needs_given && trace->of.is_narrow) {
        look_up_narrow(trace);
    } else if (trace->of.needs_given) {
        const int32_t fitting = look_up_given(trace);
        if (fitting < trace->n) {
            *failed_point = bins->order[trace->si[fitting]];
            return HS_ERR_SHIFT_RANGE;
        }
    }
    if (bins->keeps_originals && !trace->of.is_narrow) {
        look_up_times(trace);
    }
    return HS_OK;
}

/* Batch kernels read a little beyond the last of n entries, where any finite numbers will do. */
static const double *
end_with_zeros(double *entries, int32_t n)
{
    memset(entries + n, 0, HS_BATCH_PADDING * sizeof *entries);
    return entries;
}

hs_batch
hs_trace_batch(hs_trace *trace)
{
    hs_batch batch = {.n = trace->n};
    for (int k = 0; k < trace->search->scene.ndim; k++) {
        batch.p[k] = end_with_zeros(trace->p[k], trace->n);
        batch.q[k] = end_with_zeros(trace->q[k], trace->n);
    }
    for (int r = 0; trace->is_shifted && r < trace->search->scene.lattice.n_periodic; r++) {
        batch.shift[r] = end_with_zeros(trace->times[r], trace->n);
    }
    return batch;
}

const int64_t *
hs_trace_pair(const hs_trace *trace, int32_t e, double *p, double *q, int64_t *shift)
{
    const bool as_given = trace->search->bins.keeps_originals;
    for (int k = 0; k < trace->search->scene.ndim; k++) {
        p[k] = trace->p[k][e];
        q[k] = trace->q[k][e];
    }
    if (!trace->is_shifted) {
        return NULL;
    }
    for (int r = 0; r < trace->search->scene.lattice.n_periodic; r++) {
        shift[r] = as_given ? trace->given[r][e] : trace->image[r][e];
    }
    return shift;
}
