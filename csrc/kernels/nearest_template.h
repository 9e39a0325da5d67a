/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * nearest_template.h: the vector loops of a search for the nearest, once for each instruction set.
 * Include it after a vocabulary (simd_<isa>.h), inside that instruction set's target region.
 * Defines gather_relative (hs_gather_relative_fn), order (hs_order_fn), near_boxes (hs_boxes_fn).
 */

HS_ALWAYS_INLINE void
gather_relative_runs(const hs_relative_keys *keys, const hs_nearest_run *runs, int32_t n_runs,
                     const int ndim)
{
    const floats   most = broadcast((float)keys->extent);
    const floats   least = broadcast(-(float)keys->extent);
    const integers lanes = lane_numbers();
    const double   unit = keys->unit;
    for (int32_t r = 0; r < n_runs; r++) {
        const hs_nearest_run *run = &runs[r];
        const double         *moved = keys->images[run->image].moved;
        for (int32_t c = 0; c < run->n; c += LANES) {
            const int32_t to = run->at + c, si = run->si + c;
            for (int k = 0; k < ndim; k++) {
                const double *x = keys->x[k] + si;
                const floats  y = load_relative(x, moved[k], keys->centre[k], unit);
                store(keys->y[k] + to, larger_of(smaller_of(y, most), least));
            }
            store_integers(keys->number + to, add_integers(lanes, broadcast_integer(si)));
        }
    }
}

static void
gather_relative(const hs_relative_keys *keys, const hs_nearest_run *runs, int32_t n)
{
    switch (keys->ndim) {
    case 2: gather_relative_runs(keys, runs, n, 2); break;
    case 3: gather_relative_runs(keys, runs, n, 3); break;
    default: gather_relative_runs(keys, runs, n, keys->ndim); break;
    }
}

/* Each key goes to the place that is the number of smaller ones, which are counted for two vectors
 * of keys at once. */
static void
order(const float *squares, int32_t n, int32_t *keys)
{
    const integers other_bits = broadcast_integer(-HS_ORDER_MOST); /* than those of numbers */
    const integers lanes = lane_numbers();
    int32_t        own[HS_ORDER_MOST], place[HS_ORDER_MOST];
    for (int32_t e = 0; e < n; e += LANES) {
        const integers number = add_integers(lanes, broadcast_integer(e));
        const integers square = bits_in_both(bits_of(load(squares + e)), other_bits);
        store_integers(own + e, add_integers(square, number));
    }
    for (int32_t e = n; e % (2 * LANES) != 0; e++) {
        own[e] = HS_ORDER_LAST;
    }
    for (int32_t e = 0; e < n; e += 2 * LANES) {
        const integers one = load_integers(own + e), other = load_integers(own + e + LANES);
        integers       below_one = broadcast_integer(0), below_other = below_one;
        for (int32_t f = 0; f < n; f++) {
            const integers key = broadcast_integer(own[f]);
            below_one = count_greater(below_one, one, key);
            below_other = count_greater(below_other, other, key);
        }
        store_integers(place + e, below_one);
        store_integers(place + e + LANES, below_other);
    }
    for (int32_t e = 0; e < n; e++) {
        keys[place[e]] = own[e];
    }
}

HS_ALWAYS_INLINE int32_t
list_boxes(const hs_boxes *boxes, const int ndim)
{
    const floats zero = broadcast(0.0f), out = broadcast(boxes->out);
    floats       from[HS_MAX_DIM], to[HS_MAX_DIM];
    int32_t      at = 0;
    for (int k = 0; k < ndim; k++) {
        from[k] = broadcast(boxes->from[k]);
        to[k] = broadcast(boxes->to[k]);
    }
    for (int32_t c = 0; c < boxes->n; c += LANES) {
        floats s = zero;
        for (int k = 0; k < ndim; k++) {
            const floats below = subtract(load(boxes->low[k] + c), to[k]);
            const floats above = subtract(from[k], load(boxes->high[k] + c));
            const floats gap = larger_of(larger_of(below, above), zero);
            s = multiply_add(gap, gap, s);
        }
        mask near = not_greater(s, out);
        if (HS_UNLIKELY(boxes->n - c < LANES)) {
            near = (mask)(near & first_lanes(boxes->n - c));
        }
        at += append(boxes->hits + at, load_integers(boxes->label + c), near);
    }
    return at;
}

static int32_t
near_boxes(const hs_boxes *boxes)
{
    switch (boxes->ndim) {
    case 2: return list_boxes(boxes, 2);
    case 3: return list_boxes(boxes, 3);
    default: return list_boxes(boxes, boxes->ndim);
    }
}
