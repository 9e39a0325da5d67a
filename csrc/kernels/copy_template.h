/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * copy_template.h: the vector loops that bring candidates in and pairs out, once for each
 * instruction set. Include it after a vocabulary (simd_<isa>.h), inside that instruction set's
 * target region. Defines gather (hs_gather_fn) and emit (hs_emit_fn).
 */

/* |a| as integers that order like the numbers. */
HS_ALWAYS_INLINE integers
magnitudes(floats a)
{
    return bits_in_both(bits_of(a), broadcast_integer(0x7fffffff));
}

/* LANES candidates: points from number si on. */
typedef struct gathered {
    floats   y[HS_MAX_DIM];
    integers id, number;
} gathered;

/* Those that are not surely far from the box. Never fused: every kernel leaves out the same. */
HS_ALWAYS_INLINE mask
near_lanes(const gathered *these, const hs_nearest_box *box, const int ndim)
{
    floats s = broadcast(0.0f);
    for (int k = 0; k < ndim; k++) {
        const floats below = subtract(broadcast(box->low[k]), these->y[k]);
        const floats above = subtract(these->y[k], broadcast(box->high[k]));
        const floats gap = larger_of(broadcast(0.0f), larger_of(below, above));
        s = add(s, multiply(gap, gap));
    }
    return not_greater(s, broadcast(box->out));
}

/* Stores those in m; returns how many. */
HS_ALWAYS_INLINE int32_t
append_lanes(const hs_gather *gather, int32_t at, const gathered *these, mask m, const int ndim)
{
    for (int k = 0; k < ndim; k++) {
        append_floats(gather->y[k] + at, these->y[k], m);
    }
    (void)append(gather->id + at, these->id, m);
    return append(gather->number + at, these->number, m);
}

HS_ALWAYS_INLINE void
gather_runs(hs_gather *gather, hs_run *runs, int32_t n_runs, const int ndim, const bool prunes)
{
    const hs_gather own = *gather; /* arrays do not overlap it */
    const int32_t   first = own.n;
    int32_t         at = first, from = runs[0].at;
    integers        largest = broadcast_integer((int32_t)own.largest);
    for (int32_t r = 0; r < n_runs; r++) {
        const hs_run *run = &runs[r];
        const int32_t n = runs[r + 1].at - from;
        from = runs[r + 1].at;
        runs[r].at = at;
        for (int32_t c = 0; c < n; c += LANES) {
            const int64_t si = (int64_t)run->si + c;
            gathered      these;
            for (int k = 0; k < ndim; k++) {
                these.y[k] = load_relative(own.x[k] + si, run->moved[k], 0.0, 1.0);
            }
            these.id = load_integers(own.order + si);
            these.number = add_integers(lane_numbers(), broadcast_integer((int32_t)si));
            for (int k = 0; !prunes && k < ndim; k++) {
                const integers sizes = magnitudes(these.y[k]);
                store(own.y[k] + at + c, these.y[k]);
                largest = larger(largest, n - c < LANES ? keep_lanes(sizes, n - c) : sizes);
            }
            if (!prunes) {
                store_integers(own.id + at + c, these.id);
                store_integers(own.number + at + c, these.number);
                continue;
            }
            mask near = near_lanes(&these, &own.near, ndim);
            if (HS_UNLIKELY(n - c < LANES)) {
                near = (mask)(near & first_lanes(n - c));
            }
            at += append_lanes(&own, at, &these, near, ndim);
        }
        at += prunes ? 0 : n;
    }
    /* What was left out does not count, so that what was kept is read again. */
    for (int k = 0; prunes && k < ndim; k++) {
        int32_t c = first;
        for (; c + LANES <= at; c += LANES) {
            largest = larger(largest, magnitudes(load(own.y[k] + c)));
        }
        if (c < at) {
            largest = larger(largest, keep_lanes(magnitudes(load(own.y[k] + c)), at - c));
        }
    }
    gather->largest = (uint32_t)largest_lane(largest);
    gather->n = at;
}

HS_ALWAYS_INLINE void
gather_dimensions(hs_gather *gather, hs_run *runs, int32_t n, const bool prunes)
{
    switch (gather->ndim) {
    case 2: gather_runs(gather, runs, n, 2, prunes); break;
    case 3: gather_runs(gather, runs, n, 3, prunes); break;
    default: gather_runs(gather, runs, n, gather->ndim, prunes); break;
    }
}

static void
gather(hs_gather *gather, hs_run *runs, int32_t n)
{
    if (gather->near.out < INFINITY) {
        gather_dimensions(gather, runs, n, true);
    } else {
        gather_dimensions(gather, runs, n, false);
    }
}

/* Writes entries of a column from `at` on. */
HS_ALWAYS_INLINE void
put(void *column, int32_t at, integers entries, const bool wide)
{
    const size_t width = wide ? sizeof(int64_t) : sizeof(int32_t);
    char        *to = (char *)column + (size_t)at * width;
    hs_prefetch_later(to, LANES * width);
    if (wide) {
        store_wide((int64_t *)(void *)to, entries);
    } else {
        store_integers((int32_t *)(void *)to, entries);
    }
}

HS_ALWAYS_INLINE void
emit_columns(const hs_hits *hits, void *i, void *j, const bool wide)
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
emit(const hs_hits *hits, int index_bytes, void *i, void *j)
{
    if (index_bytes == 8) {
        emit_columns(hits, i, j, true);
    } else {
        emit_columns(hits, i, j, false);
    }
}
