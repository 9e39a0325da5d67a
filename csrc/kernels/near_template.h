/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * near_template.h: the vector loops of a search for the nearest, once for each instruction set.
 * Include it as scan_template.h. Defines relate (hs_relate_fn) and order (hs_order_fn).
 */

HS_ALWAYS_INLINE void
relate_runs(const hs_relate *relate, const hs_near_run *runs, int32_t n_runs, const int ndim)
{
    const float     extent = (float)relate->extent;
    const integers  lanes = lane_numbers();
    const double    unit = relate->unit;
    for (int32_t r = 0; r < n_runs; r++) {
        const hs_near_run *run = &runs[r];
        const double      *moved = relate->images[run->image].moved;
        for (int32_t c = 0; c < run->n; c += LANES) {
            const int32_t to = run->at + c, si = run->si + c;
            floats        sum = broadcast(0.0f);
            for (int k = 0; k < ndim; k++) {
                const floats y = load_relative(relate->x[k] + si, moved[k], relate->centre[k], unit);
                const floats place = within(y, extent);
                store(relate->y[k] + to, place);
                sum = multiply_add(place, place, sum);
            }
            store(relate->norm + to, sum);
            store_integers(relate->number + to, add_integers(lanes, broadcast_integer(si)));
        }
    }
}

static void
relate(const hs_relate *relate, const hs_near_run *runs, int32_t n)
{
    switch (relate->ndim) {
    case 2: relate_runs(relate, runs, n, 2); break;
    case 3: relate_runs(relate, runs, n, 3); break;
    default: relate_runs(relate, runs, n, relate->ndim); break;
    }
}

/* Each key goes to the place that is the number of smaller ones. */
static void
order(const float *squares, int32_t n, int32_t *keys)
{
    const integers number_bits = broadcast_integer(HS_ORDER_MOST - 1);
    const integers lanes = lane_numbers();
    int32_t        own[HS_ORDER_MOST], place[HS_ORDER_MOST];
    for (int32_t e = 0; e < n; e += LANES) {
        const integers number = add_integers(lanes, broadcast_integer(e));
        const integers key = merge_bits(bits_of(load(squares + e)), number, number_bits);
        store_integers(own + e, key);
    }
    for (int32_t e = n; e % LANES != 0; e++) {
        own[e] = HS_ORDER_LAST;
    }
    for (int32_t e = 0; e < n; e += LANES) {
        const integers key = load_integers(own + e);
        integers       smaller_ones = broadcast_integer(0);
        for (int32_t f = 0; f < n; f++) {
            smaller_ones = count_greater(smaller_ones, key, broadcast_integer(own[f]));
        }
        store_integers(place + e, smaller_ones);
    }
    for (int32_t e = 0; e < n; e++) {
        keys[place[e]] = own[e];
    }
}
