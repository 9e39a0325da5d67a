/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * close_gaps.c: sorts the far magnitudes of each column and moves them closer to zero.
 *
 * Why pairs stay what they are. Let u be the unit, so that the cutoff is below 2 u. The magnitudes
 * of a column are taken in ascending order. One that is more than 8 u beyond the one before it
 * moves to some 4 u to 12 u from it, and all that follow move with it. Numbers up to 2^54 u move by
 * multiples of 4 u: they are multiples of a unit in their last place, which is at most 2 u, and
 * become smaller, so that nothing is rounded. Larger numbers are multiples of 4 u, so each is 4 u
 * or more from all others: only which are equal matters, and each follows at the next multiple. So
 * every difference of two coordinates stays what it is to the last bit, or was more than 2 u and is
 * so still. None becomes larger, so all are float64 numbers, wherever closing begins.
 *
 * Along a periodic axis of length L, all x lie in [-L/2, L/2] first, and L/2 takes part as one more
 * number. Across the face, the difference of two points is the sum of L/2 - |x| and L/2 - |y|, and
 * each of these stays as it is, or stays more than the cutoff. Queries take part as if they were
 * points: the differences that count are between both.
 *
 * Where scaling loses digits, pairs are decided on coordinates and box vectors that are not scaled.
 * Those with closed gaps will do: differences are what they were. But S also counts the turns that
 * were made here, so a column with such turns is decided on as it was given, and so is its box
 * vector.
 */
#include "close_gaps.h"

#include "../base/radix_sort.h"
#include "unit.h"
#include "../box/wrap.h"

#include <math.h>
#include <string.h>

/* Extent of one axis after closing, per point, where all points are apart. */
#define UNITS_PER_POINT 8.0

/* Stands for half a box vector among the keys. Points are numbers from 0 on, queries from -2 on
 * downwards. */
#define HALF (-1)

/* From here on half a box entry is exact: its last place is at least twice the smallest number. */
#define LEAST_HALF 0x1p-1022

/* What one call of hs_condense works with. */
typedef struct condensing {
    hs_account       *account;
    const hs_options *options;
    hs_cloud         *of[HS_CONDENSED_SETS]; /* points, and queries if there are any */
    int               n_sets;
    int64_t           n; /* of both together */
    hs_condensed     *condensed;
    bool              changes_rows; /* gaps of box vectors may be closed, too */
    bool              keeps_given;  /* columns that are wrapped, as they were before */
    hs_scale          to_units, from_units;
    double            far;    /* gaps are closed from here on, in the caller's unit */
    double            coarse; /* 2^54 u, in the caller's unit */
    hs_keys           keys;   /* room for n + 1 */
} condensing;

/* The number that stands for entry i of a set among the keys. */
static int32_t
id_of(int set, int64_t i)
{
    return set == 0 ? (int32_t)i : (int32_t)(HALF - 1 - i);
}

/* The coordinate that a number stands for. */
static double *
coordinate_of(const condensing *doing, int k, int32_t id)
{
    return id >= 0 ? &doing->of[0]->x[k][id] : &doing->of[1]->x[k][HALF - 1 - (int64_t)id];
}

/* Box vectors are left alone where closing would change a decision on the points as given: in
 * coupled boxes, and for precision="double". */
static bool
rows_may_change(const condensing *doing, const hs_box *box)
{
    for (int k = 0; box != NULL && k < box->ndim; k++) {
        if (hs_mover_of(box, k) == HS_COUPLED) {
            return false;
        }
    }
    return box == NULL || doing->options->precision != HS_DOUBLE;
}

static bool
anything_is_far(const hs_cloud *cloud, const hs_box *box, int unit, int powers)
{
    bool found = hs_is_far(cloud->largest, unit, powers);
    for (int l = 0; box != NULL && l < box->ndim; l++) {
        for (int k = 0; box->periodic[l] && k < box->ndim; k++) {
            found = found || hs_is_far(0.5 * fabs(box->rows[l][k]), unit, powers);
        }
    }
    return found;
}

/* Copies the column of both sets before any number in it is wrapped. */
static hs_status
keep_given(const condensing *doing, int k)
{
    for (int set = 0; set < doing->n_sets; set++) {
        const hs_cloud *cloud = doing->of[set];
        double        **given = &doing->condensed->given[set][k];
        *given = hs_alloc(doing->account, HS_FOR_ORIGINALS, cloud->n, sizeof **given);
        if (*given == NULL) {
            return HS_ERR_MEMORY;
        }
        memcpy(*given, cloud->x[k], (size_t)cloud->n * sizeof **given);
    }
    return HS_OK;
}

/* Makes room for the turns of a column, all zero. */
static hs_status
begin_turns(const condensing *doing, int set, int k)
{
    hs_condensed *condensed = doing->condensed;
    const int64_t n = doing->of[set]->n;
    int64_t      *turns = hs_alloc(doing->account, HS_FOR_WRAPS, n, sizeof *turns);
    condensed->turns[set][k] = turns;
    if (turns == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(turns, 0, (size_t)n * sizeof *turns);
    condensed->has_turns = true;
    return doing->keeps_given && condensed->given[0][k] == NULL ? keep_given(doing, k) : HS_OK;
}

/* Wraps what is far into the box; turns are counted where S is wanted. */
static hs_status
wrap_far(const condensing *doing, int set, int k, double length, hs_failure *failure)
{
    double *x = doing->of[set]->x[k];
    for (int64_t i = 0; i < doing->of[set]->n; i++) {
        int64_t turned = 0;
        if (!(fabs(x[i]) > doing->far)) {
            continue;
        }
        const double wrapped = hs_wrap_axis(x[i], length, &turned);
        if ((doing->options->want & HS_WANT_SHIFT) && turned != 0) {
            if (turned == HS_WRAP_UNKNOWN) {
                failure->row = i;
                failure->in_queries = set > 0;
                return HS_ERR_SHIFT_RANGE;
            }
            int64_t *const *turns = &doing->condensed->turns[set][k];
            if (*turns == NULL && begin_turns(doing, set, k) != HS_OK) {
                return HS_ERR_MEMORY;
            }
            (*turns)[i] = turned;
        }
        x[i] = wrapped;
    }
    return HS_OK;
}

/* Of the magnitude, which orders like the number. */
static int64_t
bits_of(double x)
{
    return (int64_t)hs_bits_of_double(fabs(x));
}

/* The magnitudes of a column, ascending, in units. */
typedef struct places {
    double last;  /* the last one, */
    double place; /* where it went, */
    double moved; /* and, unless it is beyond 2^54 u, by what */
} places;

/* Where the next magnitude goes, and all that are equal to it. */
static double
next_place(places *at, double x, bool is_coarse)
{
    const double after = 4.0 * (ceil(0.25 * at->place) + 1.0);
    if (is_coarse) {
        at->place = after;
    } else {
        if (x - at->last > 8.0) {
            at->moved = 4.0 * floor(0.25 * (x - after));
        }
        at->place = x - at->moved;
    }
    at->last = x;
    return at->place;
}

/* A place as a coordinate of the scene. */
static double
placed(const condensing *doing, double place)
{
    return doing->condensed->is_scaled ? place : hs_scale_apply(doing->from_units, place);
}

/* Lists the magnitudes beyond `from`, `half` among them if it is one; returns how many. The
 * largest of the others is where places begin. */
static int64_t
collect(condensing *doing, int k, double from, double half, places *at)
{
    hs_keys *keys = &doing->keys;
    int64_t  found = 0;
    double   largest = 0.0;
    for (int set = 0; set < doing->n_sets; set++) {
        double *x = doing->of[set]->x[k];
        for (int64_t i = 0; i < doing->of[set]->n; i++) {
            if (fabs(x[i]) > from) {
                keys->keys[found] = bits_of(x[i]);
                keys->ids[found++] = id_of(set, i);
                continue;
            }
            largest = hs_larger(fabs(x[i]), largest);
            if (doing->condensed->is_scaled) {
                x[i] = hs_scale_apply(doing->to_units, x[i]);
            }
        }
    }
    if (half > from) {
        keys->keys[found] = bits_of(half);
        keys->ids[found++] = HALF;
    }
    at->last = at->place = hs_scale_apply(doing->to_units, largest);
    at->moved = 0.0;
    return found;
}

/* Closes the gaps of a column from `from` on, and *half, which is 0 along an open axis. */
static hs_status
condense_numbers(condensing *doing, int k, double from, double *half)
{
    const hs_keys  *keys = &doing->keys;
    places          at;
    const int64_t   found = collect(doing, k, from, *half, &at);
    const hs_status status = hs_keys_sort(&doing->keys, 0, found);
    double          place = 0.0;
    *half = placed(doing, hs_scale_apply(doing->to_units, *half)); /* unless it is far */
    for (int64_t e = 0; e < found && status == HS_OK; e++) {
        if (e == 0 || keys->keys[e] != keys->keys[e - 1]) {
            const double size = hs_double_of_bits((uint64_t)keys->keys[e]);
            const bool   is_coarse = size > doing->coarse;
            const double x_units = is_coarse ? at.last : hs_scale_apply(doing->to_units, size);
            place = placed(doing, next_place(&at, x_units, is_coarse));
        }
        if (keys->ids[e] == HALF) {
            *half = place;
        } else {
            double *x = coordinate_of(doing, k, keys->ids[e]);
            *x = copysign(place, *x);
        }
    }
    return status;
}

/* Sets the range of a column: each cloud gets that of both. */
static void
measure_column(const condensing *doing, int k)
{
    double lower = INFINITY, upper = -INFINITY;
    for (int set = 0; set < doing->n_sets; set++) {
        const hs_cloud *cloud = doing->of[set];
        for (int64_t i = 0; i < cloud->n; i++) {
            lower = hs_smaller(cloud->x[k][i], lower);
            upper = hs_larger(cloud->x[k][i], upper);
        }
    }
    for (int set = 0; set < doing->n_sets; set++) {
        doing->of[set]->lower[k] = lower;
        doing->of[set]->upper[k] = upper;
    }
}

static hs_status
condense_column(condensing *doing, int k, hs_failure *failure)
{
    const hs_cloud *cloud = doing->of[0]; /* its range is that of both */
    hs_condensed   *condensed = doing->condensed;
    const double    far = doing->far;
    const int       row = hs_mover_of(condensed->box, k);
    double         *entry = row >= 0 ? &condensed->rows.rows[row][k] : NULL;
    double          half = row >= 0 ? 0.5 * fabs(*entry) : 0.0;
    const bool      is_far = hs_larger(-cloud->lower[k], cloud->upper[k]) > far || half > far;
    if (!is_far && !condensed->is_scaled) {
        return HS_OK;
    }
    for (int set = 0; is_far && row >= 0 && set < doing->n_sets; set++) {
        const hs_status status = wrap_far(doing, set, k, fabs(*entry), failure);
        if (status != HS_OK) {
            return status;
        }
    }
    const bool condenses = is_far && (row < 0 || half > hs_larger(far, LEAST_HALF));
    /* What is dense enough already is left alone, so that one outlier costs no sorting. */
    const double    dense = hs_scale_apply(doing->from_units, UNITS_PER_POINT * (double)doing->n);
    const double    from = condenses ? hs_smaller(dense, far) : INFINITY;
    const hs_status status = condense_numbers(doing, k, from, &half);
    if (row >= 0 && condenses) {
        *entry = copysign(2.0 * half, *entry);
    } else if (row >= 0 && condensed->is_scaled) {
        *entry = hs_scale_apply(doing->to_units, *entry);
    }
    measure_column(doing, k);
    return status;
}

/* All four arrays are one memory block, which begins with the keys. */
static bool
allocate_keys(hs_account *account, const hs_options *options, int64_t n, hs_keys *keys)
{
    keys->options = options;
    keys->keys = hs_alloc(account, HS_FOR_ORDER, n, 2 * (sizeof(int64_t) + sizeof(int32_t)));
    if (keys->keys != NULL) {
        keys->spare_keys = keys->keys + n;
        keys->ids = (int32_t *)(void *)(keys->spare_keys + n);
        keys->spare_ids = keys->ids + n;
    }
    return keys->keys != NULL;
}

/* Closes the gaps of all columns that have any, one after the other. */
static hs_status
condense_columns(condensing *doing, hs_failure *failure)
{
    const hs_cloud *cloud = doing->of[0];
    double          largest = 0.0;
    for (int k = 0; k < cloud->ndim; k++) {
        const int mover = hs_mover_of(doing->condensed->box, k);
        if (mover == HS_OPEN || (mover >= 0 && doing->changes_rows)) {
            const hs_status status = condense_column(doing, k, failure);
            if (status != HS_OK) {
                return status;
            }
        }
        largest = hs_larger(hs_larger(-cloud->lower[k], cloud->upper[k]), largest);
    }
    for (int set = 0; set < doing->n_sets; set++) {
        doing->of[set]->largest = largest;
    }
    return HS_OK;
}

hs_status
hs_condense(hs_account *account, const hs_options *options, const hs_box *box, int unit, int powers,
            hs_cloud *cloud, hs_cloud *asking, hs_condensed *condensed, hs_failure *failure)
{
    condensed->box = condensed->given_box = box;
    condensed->is_scaled = condensed->has_turns = false;
    if (cloud->n == 0 || (asking != NULL && asking->n == 0) ||
        !anything_is_far(cloud, box, unit, powers)) {
        return HS_OK;
    }
    memset(condensed->turns, 0, sizeof condensed->turns);
    memset(condensed->given, 0, sizeof condensed->given);
    condensing doing = {.account = account,
                        .options = options,
                        .of = {cloud, asking},
                        .n_sets = asking != NULL ? 2 : 1,
                        .keeps_given = unit > 0, /* scaling down may lose digits */
                        .n = cloud->n + (asking != NULL ? asking->n : 0),
                        .condensed = condensed,
                        .to_units = hs_scale_of(unit),
                        .from_units = hs_scale_of(-unit),
                        .far = ldexp(1.0, unit + powers),
                        .coarse = ldexp(1.0, unit + HS_FAR_EXPONENT)};
    doing.changes_rows = rows_may_change(&doing, box);
    if (doing.changes_rows) {
        condensed->is_scaled = unit < 0;
        if (box != NULL) {
            condensed->rows = *box;
            condensed->box = &condensed->rows;
        }
    }
    const hs_status status = allocate_keys(account, options, doing.n + 1, &doing.keys)
                                 ? condense_columns(&doing, failure)
                                 : HS_ERR_MEMORY;
    hs_free(account, doing.keys.keys);
    return status;
}

void
hs_condensed_free(hs_account *account, hs_condensed *condensed)
{
    for (int set = 0; condensed->has_turns && set < HS_CONDENSED_SETS; set++) {
        for (int k = 0; k < HS_MAX_DIM; k++) {
            hs_free(account, condensed->turns[set][k]);
            hs_free(account, condensed->given[set][k]);
            condensed->turns[set][k] = NULL;
            condensed->given[set][k] = NULL;
        }
    }
}
