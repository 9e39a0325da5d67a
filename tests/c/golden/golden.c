/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * golden.c: a hash of everything that a dozen searches return, for every kernel of this CPU. Prints
 * one line for each scene and exits with 1 if kernels or numbers of threads differ. `make golden`
 * builds it with several compilers, levels of optimisation and CPUs: all must print the same.
 *
 * Scenes are made by integers, multiplication and addition, so that they are the same bits
 * everywhere.
 */
#include "../../../csrc/halfshell.h"
#include "../support/harness.h"
#include "../support/among.h"

#define FNV_START UINT64_C(0xcbf29ce484222325)

enum { MOST_POINTS = 4000, MOST_KERNELS = 16 };

typedef struct golden_scene {
    const char *name;
    int         ndim, n;
    double      size; /* points lie in [0, size) on each axis */
    double      cutoff;
    double      pitch;    /* 0: random points; else whole multiples of this */
    double      edge;     /* of the box; 0: open space */
    double      tilt;     /* how far each box vector leans along the axis before its own */
    unsigned    periodic; /* bit l: box vector l repeats */
    bool        narrow;   /* float32 */
    double      offset;   /* added to every coordinate */
} golden_scene;

static const golden_scene scenes[] = {
    {.name = "open", .ndim = 3, .n = 3000, .size = 1.0, .cutoff = 0.11},
    {.name = "open, two points", .ndim = 3, .n = 2, .size = 1.0, .cutoff = 2.0},
    {.name = "open, clustered far away",
     .ndim = 3,
     .n = 900,
     .size = 1.0,
     .cutoff = 0.2,
     .offset = 0x1p40},
    {.name = "periodic",
     .ndim = 3,
     .n = 4000,
     .size = 1.0,
     .cutoff = 0.1,
     .edge = 1.0,
     .periodic = 7},
    {.name = "slab", .ndim = 3, .n = 2000, .size = 1.0, .cutoff = 0.13, .edge = 1.0, .periodic = 3},
    {.name = "triclinic, points outside",
     .ndim = 3,
     .n = 1500,
     .size = 3.0,
     .cutoff = 0.13,
     .edge = 1.0,
     .tilt = 0.375,
     .periodic = 7},
    {.name = "sheared",
     .ndim = 3,
     .n = 300,
     .size = 1.0,
     .cutoff = 0.3,
     .edge = 1.0,
     .tilt = 7.25,
     .periodic = 7},
    /* Thousands of candidates for each point: more than are held at a time. */
    {.name = "images",
     .ndim = 3,
     .n = 12,
     .size = 1.0,
     .cutoff = 3.75,
     .edge = 1.0,
     .tilt = 0.25,
     .periodic = 7},
    {.name = "1-D", .ndim = 1, .n = 500, .size = 1.0, .cutoff = 0.03, .edge = 1.0, .periodic = 1},
    {.name = "2-D", .ndim = 2, .n = 3000, .size = 1.0, .cutoff = 0.05, .edge = 1.0, .periodic = 3},
    {.name = "5-D",
     .ndim = 5,
     .n = 400,
     .size = 1.0,
     .cutoff = 0.5,
     .edge = 1.0,
     .tilt = 0.125,
     .periodic = 31},
    {.name = "8-D, open", .ndim = 8, .n = 200, .size = 1.0, .cutoff = 0.9},
    /* Distances of 3 are (3, 0, 0) and (2, 2, 1): many pairs exactly at the cutoff. */
    {.name = "crystal, cutoff on a shell",
     .ndim = 3,
     .n = 1000,
     .size = 10.0,
     .cutoff = 3.0,
     .pitch = 1.0,
     .edge = 10.0,
     .periodic = 7},
    /* 0.1 is no binary number: what is near the cutoff needs the last stages. */
    {.name = "crystal of 0.1, nearly ties",
     .ndim = 3,
     .n = 1000,
     .size = 10.0,
     .cutoff = 0.3,
     .pitch = 0.1},
    {.name = "float32",
     .ndim = 3,
     .n = 2000,
     .size = 1.0,
     .cutoff = 0.1,
     .edge = 1.0,
     .tilt = 0.25,
     .periodic = 7,
     .narrow = true},
    {.name = "crystal, float32",
     .ndim = 3,
     .n = 1000,
     .size = 10.0,
     .cutoff = 0.3,
     .pitch = 0.1,
     .narrow = true},
};

enum { N_SCENES = sizeof scenes / sizeof scenes[0] };

/* FNV-1a with words of four bytes in place of bytes: four times as fast, and every array here is
 * made of such words. */
static uint64_t
hash_words(uint64_t hash, const void *data, size_t bytes)
{
    for (size_t at = 0; at < bytes; at += sizeof(uint32_t)) {
        uint32_t word;
        memcpy(&word, (const char *)data + at, sizeof word);
        hash = (hash ^ word) * UINT64_C(0x100000001b3);
    }
    return hash;
}

/* Lattice points in rows of ten, or random ones; room for MOST_POINTS * HS_MAX_DIM. */
static void
make_points(const golden_scene *scene, double *x)
{
    harness_random random = {1234567};
    for (int p = 0; p < scene->n; p++) {
        for (int k = 0, rest = p; k < scene->ndim; k++, rest /= 10) {
            const double place = scene->pitch > 0.0 ? scene->pitch * (double)(rest % 10)
                                                    : scene->size * random_unit(&random);
            x[p * scene->ndim + k] = place + scene->offset;
        }
    }
}

static hs_box
make_box(const golden_scene *scene)
{
    hs_box box;
    memset(&box, 0, sizeof box);
    box.ndim = scene->ndim;
    for (int l = 0; l < scene->ndim; l++) {
        box.periodic[l] = scene->periodic >> l & 1;
        box.rows[l][l] = scene->edge;
        if (l > 0) {
            box.rows[l][l - 1] = scene->tilt;
        }
    }
    return box;
}

/* The hash of all arrays of one search, and its number of pairs. */
static uint64_t
hash_search(const hs_points *points, const hs_box *box, const hs_options *options, int64_t *n_pairs)
{
    static const unsigned wants[] = {HS_WANT_I,      HS_WANT_J,     HS_WANT_DISTANCE,
                                     HS_WANT_VECTOR, HS_WANT_SHIFT, HS_WANT_BOTH};
    const size_t          index = (size_t)options->index_bytes, d = (size_t)points->ndim;
    const size_t          widths[] = {
                 index, index, sizeof(double), d * sizeof(double), d * sizeof(int32_t), 2 * index};
    uint64_t        hash = FNV_START;
    hs_pairs       *pairs;
    const hs_status status = hs_pairs_find(AMONG(points, box), options, &pairs, NULL);
    if (status != HS_OK) {
        fprintf(stderr, "golden: %s\n", hs_status_text(status));
        exit(1);
    }
    *n_pairs = hs_pairs_length(pairs);
    for (int w = 0; w < 6; w++) {
        if (options->want & wants[w]) {
            hash = hash_words(hash, hs_pairs_array(pairs, wants[w]), (size_t)*n_pairs * widths[w]);
        }
    }
    hs_pairs_free(pairs);
    return hash;
}

/* Searches that take different paths: whole, indices alone, one quantity alone; unsorted or sorted,
 * 4 or 8 bytes, strict or not, and the rounded precisions. */
typedef struct golden_search {
    unsigned     want;
    bool         sorted, strict;
    int          index_bytes;
    hs_precision precision;
} golden_search;

static const golden_search searches[] = {
    {HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT, false, false, 8,
     HS_EXACT},
    {HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT, true, true, 4,
     HS_EXACT},
    {HS_WANT_I | HS_WANT_J, false, true, 4, HS_EXACT},
    {HS_WANT_I | HS_WANT_J, true, false, 8, HS_EXACT},
    {HS_WANT_BOTH | HS_WANT_SHIFT, false, false, 4, HS_EXACT},
    {HS_WANT_BOTH, true, false, 8, HS_EXACT},
    {HS_WANT_J, false, false, 8, HS_EXACT},
    {HS_WANT_DISTANCE, false, false, 8, HS_EXACT},
    {HS_WANT_VECTOR, false, true, 8, HS_EXACT},
    {HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE, false, false, 8, HS_DOUBLE},
    {HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT, false, true, 4, HS_SINGLE},
};

enum { N_SEARCHES = sizeof searches / sizeof searches[0] };

/* *n_pairs: what the first search finds. */
static uint64_t
hash_scene(const hs_points *points, const hs_box *box, double cutoff, const char *kernel,
           int threads, int64_t *n_pairs)
{
    uint64_t hash = FNV_START;
    for (int s = N_SEARCHES - 1; s >= 0; s--) {
        hs_options options = hs_options_default();
        int64_t    count = -1;
        options.cutoff = cutoff;
        options.kernel = kernel;
        options.threads = threads;
        options.want = searches[s].want;
        options.sorted = searches[s].sorted;
        options.inclusive = !searches[s].strict;
        options.index_bytes = searches[s].index_bytes;
        options.precision = searches[s].precision;
        const uint64_t part = hash_search(points, box, &options, n_pairs);
        hash = hash_words(hash, &part, sizeof part);
        if (hs_pairs_count(AMONG(points, box), &options, &count, NULL) != HS_OK ||
            count != *n_pairs) {
            fprintf(stderr, "golden: %lld pairs were counted, %lld found\n", (long long)count,
                    (long long)*n_pairs);
            exit(1);
        }
    }
    return hash;
}

/* Prints the line of a scene; returns how many searches differ. x, narrow: scratch,
 * MOST_POINTS * HS_MAX_DIM each. */
static int
check_scene(const golden_scene *scene, double *x, float *narrow)
{
    const char  *kernels[MOST_KERNELS];
    const int    n_kernels = hs_kernel_names(kernels, MOST_KERNELS);
    const hs_box box = make_box(scene);
    hs_points    points = {.n = scene->n, .ndim = scene->ndim};
    uint64_t     first = 0;
    int64_t      n_pairs = 0;
    int          failures = 0;
    make_points(scene, x);
    for (int e = 0; e < scene->n * scene->ndim; e++) {
        narrow[e] = (float)x[e];
    }
    points.data = scene->narrow ? (const void *)narrow : (const void *)x;
    points.real = scene->narrow ? HS_FLOAT32 : HS_FLOAT64;
    points.column_stride = scene->narrow ? sizeof(float) : sizeof(double);
    points.row_stride = scene->ndim * points.column_stride;
    /* Every kernel with another number of threads, and the first with two numbers. */
    for (int k = 0; k <= n_kernels; k++) {
        const char    *kernel = kernels[k % n_kernels];
        const uint64_t hash = hash_scene(&points, scene->edge > 0.0 ? &box : NULL, scene->cutoff,
                                         kernel, k + 1, &n_pairs);
        first = k == 0 ? hash : first;
        if (hash != first) {
            fprintf(stderr, "golden: %s: kernel %s, %d threads differ from %s alone\n", scene->name,
                    kernel, k + 1, kernels[0]);
            failures++;
        }
    }
    printf("%016llx  %7lld  %s\n", (unsigned long long)first, (long long)n_pairs, scene->name);
    return failures;
}

int
main(void)
{
    static double x[MOST_POINTS * HS_MAX_DIM];
    static float  narrow[MOST_POINTS * HS_MAX_DIM];
    int           failures = 0;
    for (int s = 0; s < N_SCENES; s++) {
        failures += check_scene(&scenes[s], x, narrow);
    }
    return failures != 0;
}
