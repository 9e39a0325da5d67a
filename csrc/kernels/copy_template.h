/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * copy_template.h: the vector loops that bring candidates in and pairs out, once for each
 * instruction set. Include it after a vocabulary (simd_<isa>.h), inside that instruction set's
 * target region. Defines gather (hs_gather_fn), emit_int32 and emit_int64 (hs_emit_fn).
 */

/* Bytes from a pair to where memory is prefetched for later ones, so that their stores find it in
 * the cache. */
#define AHEAD 1024
#define LINE  64 /* bytes that are fetched at once */

/* Largest magnitude of n floats. */
HS_ALWAYS_INLINE integers
largest_of(const float *y, int32_t n, integers largest)
{
    int32_t c = 0;
    for (; c + LANES <= n; c += LANES) {
        largest = larger(largest, magnitudes(load(y + c)));
    }
    return c < n ? larger(largest, keep_lanes(magnitudes(load(y + c)), n - c)) : largest;
}

HS_ALWAYS_INLINE void
gather_runs(hs_gather *gather, const hs_run *runs, int32_t n_runs, const int ndim)
{
    const int32_t *order = gather->order;
    int32_t       *id = gather->id;
    const double  *x[HS_MAX_DIM];
    float         *norm = gather->norm;
    float         *y[HS_MAX_DIM];
    for (int k = 0; k < ndim; k++) {
        x[k] = gather->x[k];
        y[k] = gather->y[k];
    }
    for (int32_t r = 0; r < n_runs; r++) {
        const hs_run *run = &runs[r];
        const int32_t end = run[1].at;
        int64_t       si = run->si;
        for (int32_t c = run->at; c < end; c += LANES, si += LANES) {
            floats sum = broadcast(0.0f);
            for (int k = 0; k < ndim; k++) {
                const floats place = load_moved(x[k] + si, run->moved[k]);
                store(y[k] + c, place);
                sum = multiply_add(place, place, sum);
            }
            store(norm + c, sum);
            store_integers(id + c, load_integers(order + si));
        }
    }
    integers largest = broadcast_integer((int32_t)gather->largest);
    for (int k = 0; k < ndim; k++) {
        const int32_t first = runs[0].at;
        largest = largest_of(y[k] + first, runs[n_runs].at - first, largest);
    }
    gather->largest = (uint32_t)largest_lane(largest);
}

static void
gather(hs_gather *gather, const hs_run *runs, int32_t n)
{
    switch (gather->ndim) {
    case 2: gather_runs(gather, runs, n, 2); break;
    case 3: gather_runs(gather, runs, n, 3); break;
    default: gather_runs(gather, runs, n, gather->ndim); break;
    }
}

/* Writes entries of a column from `at` on. */
HS_ALWAYS_INLINE void
put(void *column, int32_t at, integers entries, const bool wide)
{
    const size_t    width = wide ? sizeof(int64_t) : sizeof(int32_t);
    char           *to = (char *)column + (size_t)at * width;
    const uintptr_t ahead = (uintptr_t)to + AHEAD; /* may lie behind the column */
    for (size_t line = 0; line < LANES * width; line += LINE) {
        HS_PREFETCH_WRITE((void *)(ahead + line));
    }
    if (wide) {
        store_wide((int64_t *)(void *)to, entries);
    } else {
        store_integers((int32_t *)(void *)to, entries);
    }
}

HS_ALWAYS_INLINE void
emit(const hs_hits *hits, void *i, void *j, const bool wide)
{
    int32_t h = 0;
    for (int32_t t = 0; t < hits->n; t++) {
        const integers point = broadcast_integer(hits->point[t]);
        const int32_t  end = hits->end[t];
        for (int32_t at = h; at < end; at += LANES) {
            const integers hit = load_integers(hits->label + at);
            if (i != NULL) {
                put(i, at, smaller(hit, point), wide);
            }
            if (j != NULL) {
                put(j, at, larger(hit, point), wide);
            }
        }
        h = end;
    }
}

static void
emit_int32(const hs_hits *hits, void *i, void *j)
{
    if (i != NULL && j != NULL) {
        emit(hits, i, j, false);
    } else if (i != NULL) {
        emit(hits, i, NULL, false);
    } else {
        emit(hits, NULL, j, false);
    }
}

static void
emit_int64(const hs_hits *hits, void *i, void *j)
{
    if (i != NULL && j != NULL) {
        emit(hits, i, j, true);
    } else if (i != NULL) {
        emit(hits, i, NULL, true);
    } else {
        emit(hits, NULL, j, true);
    }
}
