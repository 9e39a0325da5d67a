/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * pairs.c: points are sorted into cells once and asked three times: for their pairs, for the
 * neighbours of a query, and for each pair in a function. Everything is freed.
 *
 *     make; build/pairs [points along each axis [cutoff in units of the spacing]]
 *
 * The points are a cubic lattice with a spacing of 0.1 in open space. 0.1 is no binary number, so
 * that floats of distances would often say the wrong thing about a cutoff on a shell, as 3 is.
 */
#include "halfshell.h"

#include <stdio.h>
#include <stdlib.h>

enum { NDIM = 3, MOST_ALONG = 100 };

static hs_points
view_of(const double *points, int64_t n)
{
    return (hs_points){.data = points,
                       .n = n,
                       .ndim = NDIM,
                       .real = HS_FLOAT64,
                       .row_stride = NDIM * sizeof(double),
                       .column_stride = sizeof(double)};
}

static void
make_lattice(int64_t along, double *points)
{
    for (int64_t p = 0; p < along * along * along; p++) {
        points[NDIM * p] = 0.1 * (double)(p % along);
        points[NDIM * p + 1] = 0.1 * (double)(p / along % along);
        points[NDIM * p + 2] = 0.1 * (double)(p / along / along);
    }
}

/* The pairs as arrays: borrowed from the result until it is freed. */
static hs_status
print_pairs(const hs_cells *cells, const hs_options *options, hs_failure *failure)
{
    hs_options     arrays = *options;
    hs_pairs      *pairs;
    const hs_among among = {.cells = cells};
    arrays.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
    arrays.sorted = true;
    const hs_status status = hs_pairs_find(&among, &arrays, &pairs, failure);
    if (status != HS_OK) {
        return status;
    }
    const int64_t  n = hs_pairs_length(pairs);
    const int64_t *i = hs_pairs_array(pairs, HS_WANT_I);
    const int64_t *j = hs_pairs_array(pairs, HS_WANT_J);
    const double  *d = hs_pairs_array(pairs, HS_WANT_DISTANCE);
    printf("pairs %lld\n", (long long)n);
    for (int64_t e = 0; e < n && e < 3; e++) {
        printf("pair %lld %lld %.17g\n", (long long)i[e], (long long)j[e], d[e]);
    }
    hs_pairs_free(pairs);
    return HS_OK;
}

/* The neighbours of the origin: the one row of a table, taken from the result to be kept. */
static hs_status
print_neighbors(const hs_cells *cells, const hs_options *options, hs_failure *failure)
{
    static const double origin[NDIM] = {0.0, 0.0, 0.0};
    const hs_set        query = {.at = view_of(origin, 1)};
    const hs_among      among = {.cells = cells, .queries = &query};
    hs_options          list = *options;
    hs_pairs           *rows;
    list.want = HS_WANT_J;
    const hs_status status = hs_neighbors_find(&among, &list, &rows, failure);
    if (status != HS_OK) {
        return status;
    }
    const int64_t n = hs_pairs_offsets(rows)[1];
    int64_t      *neighbors = hs_pairs_take(rows, HS_WANT_J);
    hs_pairs_free(rows);
    printf("neighbors %lld:", (long long)n);
    for (int64_t e = 0; e < n && e < 5; e++) {
        printf(" %lld", (long long)neighbors[e]);
    }
    printf("\n");
    hs_array_free(neighbors);
    return HS_OK;
}

static int
add_square(int64_t i, int64_t j, const int32_t *S, const double *D, double d2, void *user)
{
    (void)i;
    (void)j;
    (void)S;
    (void)D;
    *(double *)user += d2;
    return 0; /* go on */
}

/* No pair is stored: each is handed to a function. */
static hs_status
print_sum(const hs_cells *cells, const hs_options *options, hs_failure *failure)
{
    const hs_among  among = {.cells = cells};
    double          sum = 0.0;
    int64_t         n;
    const hs_visit  visit = {.pair = add_square, .user = &sum};
    const hs_status status = hs_pairs_visit(&among, options, &visit, &n, failure);
    if (status == HS_OK) {
        printf("visited %lld, sum of squares %.9g\n", (long long)n, sum);
    }
    return status;
}

static hs_status
run(const double *points, int64_t n, double cutoff, hs_failure *failure)
{
    const hs_points view = view_of(points, n);
    hs_options      options = hs_options_default();
    hs_cells       *cells;
    options.cutoff = cutoff;
    hs_status status = hs_cells_build(&view, NULL, &options, &cells, failure);
    if (status == HS_OK) { /* else there are no cells to free */
        status = print_pairs(cells, &options, failure);
        status = status == HS_OK ? print_neighbors(cells, &options, failure) : status;
        status = status == HS_OK ? print_sum(cells, &options, failure) : status;
        hs_cells_free(cells);
    }
    hs_pool_clear();
    return status;
}

int
main(int n_arguments, char **arguments)
{
    const long   along = n_arguments > 1 ? strtol(arguments[1], NULL, 10) : 10;
    const double cutoff = 0.1 * (n_arguments > 2 ? strtod(arguments[2], NULL) : 3.0);
    if (along < 1 || along > MOST_ALONG) {
        fprintf(stderr, "usage: pairs [points along each axis (1 to %d) [cutoff]]\n", MOST_ALONG);
        return EXIT_FAILURE;
    }
    const int64_t n = (int64_t)along * along * along;
    double       *points = malloc((size_t)n * NDIM * sizeof *points);
    hs_status     status = HS_ERR_MEMORY;
    hs_failure    failure;
    if (points != NULL) {
        make_lattice(along, points);
        status = run(points, n, cutoff, &failure);
    }
    if (status == HS_ERR_CUTOFF) {
        fprintf(stderr, "pairs: %s, got %g\n", hs_status_text(status), failure.value);
    } else if (status != HS_OK) {
        fprintf(stderr, "pairs: %s\n", hs_status_text(status));
    }
    free(points);
    return status == HS_OK ? EXIT_SUCCESS : EXIT_FAILURE;
}
