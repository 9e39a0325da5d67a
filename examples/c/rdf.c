/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * rdf.c: the radial distribution function of a warm crystal, from halfshell.h alone.
 *
 *     make; build/rdf [cells [cutoff [bins]]]
 *
 * Prints one line a bin: its middle, g(r), and the pairs in it. The lattice is face-centred cubic,
 * of `cells` cells of length 1 along each axis, and periodic.
 */
#include "halfshell.h"

#include <stdio.h>
#include <stdlib.h>

static const double PI = 3.141592653589793;

enum { NDIM = 3, MOST_CELLS = 200 };

typedef struct settings {
    long   cells;
    double cutoff;
    long   bins;
} settings;

/* In [0, 1). Knuth's generator: the same numbers everywhere. */
static double
next_random(uint64_t *state)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(*state >> 11) * 0x1p-53;
}

/* 4 * cells^3 points, each up to a sixteenth away from its place. */
static void
make_crystal(long cells, double *points)
{
    static const double base[4][NDIM] = {
        {0.0, 0.0, 0.0}, {0.5, 0.5, 0.0}, {0.5, 0.0, 0.5}, {0.0, 0.5, 0.5}};
    uint64_t state = 1;
    double  *next = points;
    for (long cell = 0; cell < cells * cells * cells; cell++) {
        const long at[NDIM] = {cell % cells, cell / cells % cells, cell / cells / cells};
        for (int b = 0; b < 4; b++) {
            for (int k = 0; k < NDIM; k++) {
                const double moved = (next_random(&state) - 0.5) * 0.125;
                *next++ = (double)at[k] + base[b][k] + moved;
            }
        }
    }
}

/* counts[b + 1]: pairs between edges b and b + 1. counts[0]: those closer than the first edge. */
static hs_status
count_pairs(const settings *job, const double *points, int64_t n, double *edges, int64_t *counts,
            hs_failure *failure)
{
    const hs_set set = {.at = {.data = points,
                               .n = n,
                               .ndim = NDIM,
                               .real = HS_FLOAT64,
                               .row_stride = NDIM * sizeof(double),
                               .column_stride = sizeof(double)}};
    hs_box       box = {.ndim = NDIM};
    for (int k = 0; k < NDIM; k++) {
        box.periodic[k] = true;
        box.rows[k][k] = (double)job->cells;
    }
    for (long e = 0; e < job->bins; e++) {
        edges[e] = (double)e * (job->cutoff / (double)job->bins);
    }
    edges[job->bins] = job->cutoff;
    const hs_histogram histogram = {.n_edges = job->bins + 1,
                                    .edges = edges,
                                    .last_inclusive = true,
                                    .n_types = 1,
                                    .counts = counts};
    hs_options         options = hs_options_default();
    options.threads = -2; /* two, where that pays */
    const hs_among among = {.points = &set, .box = &box};
    return hs_pairs_histogram(&among, &options, &histogram, failure);
}

/* g(r) is the number of pairs over that of as many points at random. */
static void
print_table(const settings *job, int64_t n, const double *edges, const int64_t *counts)
{
    const double volume = (double)(job->cells * job->cells * job->cells);
    for (long b = 0; b < job->bins; b++) {
        const double inner = edges[b], outer = edges[b + 1];
        const double shell = 4.0 / 3.0 * PI * (outer * outer * outer - inner * inner * inner);
        const double ideal = 0.5 * (double)n * (double)n * (shell / volume);
        printf("%.6f %.12g %lld\n", 0.5 * (inner + outer), (double)counts[b + 1] / ideal,
               (long long)counts[b + 1]);
    }
}

static int
run(const settings *job)
{
    const int64_t n = 4 * (int64_t)job->cells * job->cells * job->cells;
    double       *points = malloc((size_t)n * NDIM * sizeof *points);
    double       *edges = malloc((size_t)(job->bins + 1) * sizeof *edges);
    int64_t      *counts = malloc((size_t)(job->bins + 1) * sizeof *counts);
    hs_status     status = HS_ERR_MEMORY;
    hs_failure    failure;
    if (points != NULL && edges != NULL && counts != NULL) {
        make_crystal(job->cells, points);
        status = count_pairs(job, points, n, edges, counts, &failure);
    }
    if (status == HS_OK) {
        print_table(job, n, edges, counts);
    } else {
        fprintf(stderr, "rdf: %s\n", hs_status_text(status));
    }
    free(points);
    free(edges);
    free(counts);
    hs_pool_clear();
    return status == HS_OK ? EXIT_SUCCESS : EXIT_FAILURE;
}

/* False where it is no number, or not in [least, most]. */
static bool
read_number(const char *text, double least, double most, double *number)
{
    char *end;
    *number = strtod(text, &end);
    return end != text && *end == '\0' && *number >= least && *number <= most;
}

int
main(int n_arguments, char **arguments)
{
    double cells = 8.0, cutoff = 2.0, bins = 40.0;
    if (n_arguments > 4 ||
        (n_arguments > 1 && !read_number(arguments[1], 1.0, MOST_CELLS, &cells)) ||
        (n_arguments > 2 && !read_number(arguments[2], 1e-9, 1e9, &cutoff)) ||
        (n_arguments > 3 && !read_number(arguments[3], 1.0, 1e6, &bins))) {
        fprintf(stderr, "usage: rdf [cells (1 to %d) [cutoff (1e-9 to 1e9) [bins (1 to 1e6)]]]\n",
                MOST_CELLS);
        return EXIT_FAILURE;
    }
    const settings job = {.cells = (long)cells, .cutoff = cutoff, .bins = (long)bins};
    return run(&job);
}
