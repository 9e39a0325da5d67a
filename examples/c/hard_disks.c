/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * hard_disks.c: Monte Carlo of hard disks, or with NDIM 3 of hard spheres, in a periodic box, from
 * halfshell_dynamic.h: local moves, each accepted if it makes no overlap, which is decided exactly.
 *
 *     make; build/hard_disks [ndim [n_side [packing [sweeps [seed [storage]]]]]]
 *
 * The diameter is 1; n_side^ndim of them start on a lattice. storage: 0 hash, 1 dense, 2 all-pairs.
 * Prints the compressibility factor Z = p V / (N k T) = 1 + 2^(ndim - 1) packing g(1), with its
 * standard error from blocks, and a hash of the final positions: it is the same on every machine
 * and with any compiler, because every number that the trajectory depends on is rounded in one way.
 */
#include "halfshell_dynamic.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const double PI = 3.141592653589793;

enum { BLOCKS = 16, BINS = 5, MOST_DIM = 3 };

static const double BIN = 0.01; /* width of the shells beyond contact, in diameters */

typedef struct hard_gas {
    int         ndim;
    int64_t     n;
    double      length, packing;
    hs_dynamic *list;
    double     *x;     /* n * ndim; not wrapped, so that moves are short */
    int64_t     step;  /* largest move along an axis, in units of 2^-20 */
    uint64_t    state; /* of the generator */
    int64_t     trials, accepted;
} hard_gas;

/* PCG-XSH-RR with 64 bits of state: M. E. O'Neill, PCG: a family of simple fast space-efficient
 * statistically good algorithms for random number generation, HMC-CS-2014-0905 (2014). */
static uint32_t
next_random(uint64_t *state)
{
    const uint64_t old = *state;
    const uint32_t mixed = (uint32_t)(((old >> 18) ^ old) >> 27);
    const uint32_t turn = (uint32_t)(old >> 59);
    *state = old * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return mixed >> turn | mixed << (-turn & 31);
}

static void
fail(hs_status status)
{
    fprintf(stderr, "hard_disks: %s\n", hs_status_text(status));
    exit(1);
}

/* The edge of the box, a multiple of 2^-20: roots differ in the last digit between libraries. */
static double
length_for(int ndim, double n, double packing)
{
    const double volume = n * (ndim == 2 ? PI / 4.0 : PI / 6.0) / packing;
    return ceil(pow(volume, 1.0 / ndim) * 0x1p20) * 0x1p-20;
}

static hard_gas
make_gas(int ndim, long n_side, double packing, uint64_t seed, int storage)
{
    hard_gas           gas = {.ndim = ndim, .n = 1, .step = 1 << 17, .state = 2 * seed + 1};
    hs_box             box = {.ndim = ndim};
    hs_dynamic_options options = hs_dynamic_options_default();
    for (int k = 0; k < ndim; k++) {
        gas.n *= n_side;
    }
    gas.length = length_for(ndim, (double)gas.n, packing);
    gas.packing = (double)gas.n * (ndim == 2 ? PI / 4.0 : PI / 6.0) / pow(gas.length, ndim);
    for (int k = 0; k < ndim; k++) {
        box.periodic[k] = true;
        box.rows[k][k] = gas.length;
    }
    options.ndim = ndim;
    options.box = &box;
    options.storage = (hs_storage)storage;
    options.cell_size = 1.0;
    options.max_radius = 1.0 + BINS * BIN;
    options.inclusive = false; /* those that touch do not overlap */
    const hs_status status = hs_dynamic_new(&options, &gas.list, NULL);
    gas.x = malloc((size_t)(gas.n * ndim) * sizeof *gas.x);
    if (status != HS_OK || gas.x == NULL) {
        fail(status != HS_OK ? status : HS_ERR_MEMORY);
    }
    for (int64_t i = 0; i < gas.n; i++) {
        int64_t rest = i;
        for (int k = 0; k < ndim; k++) {
            gas.x[i * ndim + k] = ((double)(rest % n_side) + 0.5) * (gas.length / (double)n_side);
            rest /= n_side;
        }
        const hs_status put = hs_dynamic_insert(gas.list, (hs_key){i, 0}, gas.x + i * ndim, NULL);
        if (put != HS_OK) {
            fail(put);
        }
    }
    return gas;
}

/* One trial move for each disk on average. A move is an integer times a power of two, so that adding
 * it is the only rounding. */
static void
sweep(hard_gas *gas)
{
    const int d = gas->ndim;
    hs_dynamic_hold(gas->list); /* the rounding mode, once for all of them */
    for (int64_t trial = 0; trial < gas->n; trial++) {
        const int64_t i = (int64_t)((uint64_t)next_random(&gas->state) * (uint64_t)gas->n >> 32);
        const hs_key  key = {i, 0};
        double        moved[MOST_DIM];
        bool          overlaps = true;
        for (int k = 0; k < d; k++) {
            const int64_t random = (int64_t)(next_random(&gas->state) >> 8) - (1 << 23);
            moved[k] = gas->x[i * d + k] + (double)(random * gas->step) * 0x1p-43;
        }
        const hs_status status =
            hs_dynamic_any_within(gas->list, moved, 1.0, &key, &overlaps, NULL);
        if (status != HS_OK) {
            fail(status);
        }
        if (!overlaps) {
            (void)hs_dynamic_move(gas->list, key, moved, NULL);
            memcpy(gas->x + i * d, moved, (size_t)d * sizeof *moved);
            gas->accepted++;
        }
    }
    gas->trials += gas->n;
    hs_dynamic_release(gas->list);
}

/* Until about half of the moves are accepted. */
static void
tune(hard_gas *gas)
{
    const int64_t most = (int64_t)(gas->length * 0x1p17);
    if (gas->accepted * 10 < gas->trials * 4) {
        gas->step -= gas->step / 8;
    } else if (gas->accepted * 10 > gas->trials * 6 && gas->step < most) {
        gas->step += gas->step / 8 + 1;
    }
    gas->trials = gas->accepted = 0;
}

typedef struct shell_counts {
    const hard_gas *gas;
    const double   *centre;
    int64_t         count[BINS];
} shell_counts;

/* Counts a neighbour by its distance. */
static int
count_shell(hs_key key, const double *position, const int64_t *shift, void *user)
{
    shell_counts *shells = user;
    double        square = 0.0;
    (void)key;
    for (int k = 0; k < shells->gas->ndim; k++) {
        const double D = position[k] - shells->centre[k] + (double)shift[k] * shells->gas->length;
        square += D * D;
    }
    if (square > 0.25) { /* not the disk itself */
        const int bin = (int)((sqrt(square) - 1.0) / BIN);
        shells->count[bin < 0 ? 0 : bin < BINS ? bin : BINS - 1]++;
    }
    return 0;
}

static void
measure(const hard_gas *gas, shell_counts *shells)
{
    for (int64_t i = 0; i < gas->n; i++) {
        shells->centre = gas->x + i * gas->ndim;
        const hs_status status = hs_dynamic_within(gas->list, shells->centre, 1.0 + BINS * BIN,
                                                   true, count_shell, shells, NULL);
        if (status != HS_OK) {
            fail(status);
        }
    }
}

/* g at contact: a parabola through the shells by least squares, at distance 1. The middle one of the
 * five is t = 0, so contact is at t = -2.5. */
static double
contact_value(const hard_gas *gas, const shell_counts *shells, double measurements)
{
    const double density = (double)gas->n / pow(gas->length, gas->ndim);
    double       sum = 0.0, first = 0.0, second = 0.0;
    for (int b = 0; b < BINS; b++) {
        const double inner = 1.0 + b * BIN, outer = inner + BIN, t = b - 2.0;
        const double volume = gas->ndim == 2 ? PI * (outer * outer - inner * inner)
                                             : 4.0 / 3.0 * PI * (pow(outer, 3.0) - pow(inner, 3.0));
        const double g =
            (double)shells->count[b] / (measurements * (double)gas->n * density * volume);
        sum += g;
        first += t * g;
        second += (t * t - 2.0) * g;
    }
    return sum / 5.0 + first / 10.0 * -2.5 + second / 14.0 * (2.5 * 2.5 - 2.0);
}

/* Whether any two overlap, by a search that knows nothing of the list. */
static int64_t
count_overlaps(const hard_gas *gas)
{
    const ptrdiff_t width = (ptrdiff_t)sizeof(double);
    const hs_set    points = {.at = {.data = gas->x,
                                     .n = gas->n,
                                     .ndim = gas->ndim,
                                     .real = HS_FLOAT64,
                                     .row_stride = gas->ndim * width,
                                     .column_stride = width}};
    hs_box          box = {.ndim = gas->ndim};
    hs_options      options = hs_options_default();
    int64_t         count = -1;
    for (int k = 0; k < gas->ndim; k++) {
        box.periodic[k] = true;
        box.rows[k][k] = gas->length;
    }
    const hs_among among = {.points = &points, .box = &box};
    options.cutoff = 1.0;
    options.inclusive = false;
    const hs_status status = hs_pairs_count(&among, &options, &count, NULL);
    if (status != HS_OK) {
        fail(status);
    }
    return count;
}

/* FNV-1a of the bits of all positions. */
static uint64_t
hash_positions(const hard_gas *gas)
{
    uint64_t hash = UINT64_C(0xCBF29CE484222325);
    for (int64_t e = 0; e < gas->n * gas->ndim; e++) {
        uint64_t bits;
        memcpy(&bits, &gas->x[e], sizeof bits);
        for (int byte = 0; byte < 8; byte++) {
            hash = (hash ^ (bits >> (8 * byte) & 0xFF)) * UINT64_C(0x100000001B3);
        }
    }
    return hash;
}

int
main(int argc, char **argv)
{
    const int    ndim = argc > 1 ? atoi(argv[1]) : 2;
    const long   n_side = argc > 2 ? atol(argv[2]) : 16;
    const double packing = argc > 3 ? atof(argv[3]) : 0.3;
    const long   sweeps = argc > 4 ? atol(argv[4]) : 640;
    const long   seed = argc > 5 ? atol(argv[5]) : 1;
    const int    storage = argc > 6 ? atoi(argv[6]) : HS_STORE_DENSE;
    double       Z[BLOCKS], mean = 0.0, variance = 0.0, seconds = 0.0;
    if ((ndim != 2 && ndim != 3) || n_side < 3 || n_side > 2000 || !(packing > 0.0) ||
        packing > (ndim == 2 ? 0.78 : 0.52) || sweeps < BLOCKS || seed < 0 || storage < 0 ||
        storage > 2) {
        fprintf(stderr, "usage: hard_disks [2|3 [n_side [packing [sweeps [seed [0|1|2]]]]]]\n");
        return 2;
    }
    hard_gas gas = make_gas(ndim, n_side, packing, (uint64_t)seed, storage);
    for (long s = 0; s < sweeps / 4; s++) {
        sweep(&gas);
        tune(&gas);
    }
    for (int b = 0; b < BLOCKS; b++) {
        shell_counts shells = {.gas = &gas};
        for (long s = 0; s < sweeps / BLOCKS; s++) {
            const clock_t begun = clock();
            sweep(&gas);
            seconds += (double)(clock() - begun) / CLOCKS_PER_SEC;
            measure(&gas, &shells);
        }
        Z[b] = 1.0 + (ndim == 2 ? 2.0 : 4.0) * gas.packing *
                         contact_value(&gas, &shells, (double)(sweeps / BLOCKS));
        mean += Z[b] / BLOCKS;
    }
    for (int b = 0; b < BLOCKS; b++) {
        variance += (Z[b] - mean) * (Z[b] - mean) / (BLOCKS - 1);
    }
    printf("n %lld\npacking %.6f\nstep %.6f\nacceptance %.4f\n", (long long)gas.n, gas.packing,
           (double)gas.step * 0x1p-20, (double)gas.accepted / (double)gas.trials);
    printf("bytes_per_disk %.1f\n", (double)hs_dynamic_look(gas.list).bytes / (double)gas.n);
    printf("moves_per_second %.4g\nZ %.5f\nerror %.5f\noverlaps %lld\nhash %016llx\n",
           (double)gas.trials / seconds, mean, sqrt(variance / BLOCKS),
           (long long)count_overlaps(&gas), (unsigned long long)hash_positions(&gas));
    hs_dynamic_free(gas.list);
    free(gas.x);
    return 0;
}
