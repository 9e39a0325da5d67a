/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * fuzz_pairs.c: bytes become a small scene; find and count, and one other kind of search for each
 * scene, must agree with the brute force. The numbers are lattice steps near ties, or any bit pattern
 * at all. Aborts on any difference.
 */
#include <stdio.h>

#include "../support/among.h"
#include "../support/answers.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define MOST_TESTS 1500.0    /* images that the brute force looks at */
#define PLAN_LIMIT (1 << 20) /* bytes; keeps plans of hopeless scenes short */

/* Whether each scene is searched in all ways, and not in one. */
#if !defined(FUZZ_ALL_ANSWERS)
#define FUZZ_ALL_ANSWERS 0
#endif

typedef struct input {
    const uint8_t *at, *end;
} input;

/* Zeros after the end. */
static uint64_t
take(input *in, int bytes)
{
    uint64_t value = 0;
    for (int b = 0; b < bytes; b++)
        value |= (uint64_t)(in->at < in->end ? *in->at++ : 0) << (8 * b);
    return value;
}

static double
steps_from(double value, int steps)
{
    for (; steps > 0; steps--)
        value = nextafter(value, INFINITY);
    for (; steps < 0; steps++)
        value = nextafter(value, -INFINITY);
    return value;
}

/* One number of the kind: lattice steps, the same but for some units in the last place, the same
 * times any power of two, float32 bits, float64 bits. */
static double
take_number(input *in, int kind)
{
    static const double pitches[] = {1.0, 0.1, 0.25, 1.0 / 3.0};
    double              value;
    float               narrow;
    uint32_t            bits32;
    uint64_t            bits;
    switch (kind) {
    default: return (double)(int8_t)take(in, 1) * pitches[kind & 3];
    case 4:
        value = (double)(int8_t)take(in, 1) * 0.1;
        return steps_from(value, (int)take(in, 1) % 5 - 2);
    case 5:
        value = (double)(int8_t)take(in, 1);
        return ldexp(value, (int)(int16_t)take(in, 2) % 1075);
    case 6:
        bits32 = (uint32_t)take(in, 4);
        memcpy(&narrow, &bits32, sizeof narrow);
        return (double)narrow;
    case 7:
        bits = take(in, 8);
        memcpy(&value, &bits, sizeof value);
        return value;
    }
}

typedef struct fuzz_scene {
    brute_scene scene;
    hs_box      box;
    double      x[8 * 4];
} fuzz_scene;

/* |D| of a pair in some image, rounded, and some units in the last place from there. */
static double
cutoff_near_a_pair(input *in, const fuzz_scene *f)
{
    const int     d = f->scene.ndim, bytes = (int)take(in, 1), steps = (int)take(in, 1) % 7 - 3;
    const double *p = f->x, *q = f->x + (f->scene.n > 0 ? bytes % f->scene.n : 0) * d;
    double        sum = 0.0;
    for (int k = 0; k < d; k++) {
        double along = q[k] - p[k];
        for (int l = 0; l < d && f->scene.box != NULL; l++)
            if (f->box.periodic[l] && (bytes >> (3 + l) & 1))
                along += f->box.rows[l][k];
        sum = hypot(sum, along);
    }
    return fabs(steps_from(sum, steps));
}

static void
take_box(input *in, int kind, int numbers, hs_box *box)
{
    const int d = box->ndim, flags = (int)take(in, 1);
    for (int l = 0; l < d; l++) {
        box->periodic[l] = flags >> l & 1;
        for (int k = 0; k < d; k++) {
            const bool given = kind == 2 || (kind == 1 && k == (l + (flags >> 4)) % d) ||
                               (kind == 3 && k == l);
            box->rows[l][k] = given ? take_number(in, numbers) : 0.0;
        }
    }
    for (int step = 0; kind == 3 && d > 1 && step < 2; step++) { /* shear by whole widths */
        const int    which = (int)take(in, 1), l = which % d;
        const int    other = (l + 1 + which / 4 % (d - 1)) % d;
        const double times = (double)(int8_t)take(in, 1);
        for (int k = 0; k < d; k++)
            box->rows[l][k] += times * box->rows[other][k];
    }
}

static void
take_scene(input *in, fuzz_scene *f)
{
    const int first = (int)take(in, 1), second = (int)take(in, 1), third = (int)take(in, 1);
    const int kind = second >> 1 & 3, box_numbers = second >> 3 & 7;
    memset(f, 0, sizeof *f);
    f->scene = (brute_scene){.ndim = 1 + (first & 3),
                             .n = (first >> 2) % 9,
                             .x = f->x,
                             .box = kind == 0 ? NULL : &f->box,
                             .inclusive = second & 1};
    f->box.ndim = f->scene.ndim;
    if (kind != 0)
        take_box(in, kind, box_numbers, &f->box);
    for (int e = 0; e < f->scene.n * f->scene.ndim; e++)
        f->x[e] = take_number(in, third & 7);
    f->scene.cutoff = third >> 3 & 1 ? cutoff_near_a_pair(in, f) : take_number(in, third >> 4 & 7);
}

static void
fail(const fuzz_scene *f, const char *what)
{
    fprintf(stderr, "%s\nd = %d, n = %d, cutoff %a, %s\n", what, f->scene.ndim, (int)f->scene.n,
            f->scene.cutoff, f->scene.inclusive ? "inclusive" : "strict");
    for (int l = 0; f->scene.box != NULL && l < f->scene.ndim; l++) {
        fprintf(stderr, "box vector %d, %s:", l, f->box.periodic[l] ? "periodic" : "open");
        for (int k = 0; k < f->scene.ndim; k++)
            fprintf(stderr, " %a", f->box.rows[l][k]);
        fprintf(stderr, "\n");
    }
    for (int e = 0; e < f->scene.n * f->scene.ndim; e++)
        fprintf(stderr, "%a%s", f->x[e], (e + 1) % f->scene.ndim ? " " : "\n");
    abort();
}

/* What validation must say, as far as it can be told without deciding whether rows are
 * dependent. */
static hs_status
status_of(const fuzz_scene *f)
{
    if (!(f->scene.cutoff >= 0.0) || !isfinite(f->scene.cutoff))
        return HS_ERR_CUTOFF;
    for (int e = 0; f->scene.box != NULL && e < f->scene.ndim * f->scene.ndim; e++) {
        if (!isfinite(f->box.rows[e / f->scene.ndim][e % f->scene.ndim]))
            return HS_ERR_BOX_FINITE;
    }
    for (int e = 0; e < f->scene.n * f->scene.ndim; e++)
        if (!isfinite(f->x[e]))
            return HS_ERR_NOT_FINITE;
    return HS_OK;
}

/* Scenes that the brute force cannot do are only planned: no crash, no undefined behaviour. */
static void
only_plan(const fuzz_scene *f, hs_status valid)
{
    const hs_points points = points_of(&f->scene);
    hs_options      options = options_of(&f->scene);
    hs_plan         plan;
    hs_failure      failure;
    double          wrapped[8 * 4];
    int64_t         shift[8 * 4];
    options.memory_limit = PLAN_LIMIT;
    const hs_status status = hs_plan_make(AMONG(&points, f->scene.box), &options, &plan, &failure);
    if (valid != HS_OK && status != valid &&
        !(valid == HS_ERR_NOT_FINITE && status == HS_ERR_BOX_DEPENDENT))
        fail(f, "an invalid scene was not refused as it should be");
    if (f->scene.box != NULL) {
        (void)hs_box_wrap(f->scene.box, &points, wrapped, shift, &failure);
        (void)hs_box_measure(f->scene.box, wrapped, wrapped + 8, &failure);
    }
}

/* Largest number of periods that anything in the scene spans; of the points alone, if asked. */
static long double
most_periods(const fuzz_scene *f, bool points_alone)
{
    brute_rows  r;
    long double largest = points_alone ? 0.0L : f->scene.cutoff, densest = 0.0L;
    if (!brute_prepare(&f->scene, &r))
        return INFINITY;
    for (int l = 0; l < r.m; l++) {
        densest = fmaxl(densest, r.dual_length[l]);
        for (int k = 0; k < f->scene.ndim && !points_alone; k++)
            largest = fmaxl(largest, fabsl((long double)r.rows[l][k]));
    }
    for (int e = 0; e < f->scene.n * f->scene.ndim; e++)
        largest = fmaxl(largest, fabsl((long double)f->x[e]));
    return densest * largest;
}

/*
 * Left out are skewed boxes whose vectors differ by more than float64 has digits: then the search
 * looks at very many images.
 */
static bool
is_searchable(const fuzz_scene *f)
{
    for (int l = 0; l < f->scene.ndim && f->scene.box != NULL; l++) {
        int entries = 0;
        for (int k = 0; k < f->scene.ndim && f->box.periodic[l]; k++)
            entries += f->box.rows[l][k] != 0.0;
        if (entries > 1)
            return most_periods(f, false) < 0x1p50L;
    }
    return true;
}

/* Whether `difference` is a refusal that this scene allows: points too many boxes away to be
 * counted, or numbers further apart than the exponents that the search has. */
static bool
may_refuse(const fuzz_scene *f, const brute_list *expected, const char *difference)
{
    if (strcmp(difference, hs_status_text(HS_ERR_SHIFT_RANGE)) == 0)
        return expected->farthest >= 0x1p30 || most_periods(f, true) >= 0x1p49L;
    if (strcmp(difference, hs_status_text(HS_ERR_BOX_SKEWED)) == 0)
        return most_periods(f, false) >= 0x1p44L; /* rounding across a short vector */
    return strcmp(difference, hs_status_text(HS_ERR_MEMORY)) == 0 &&
           most_periods(f, false) > 0x1p850L;
}

/* Another kernel, and algorithm, for each length of the input; its contents mean what they always meant. */
static const char *
kernel_for(size_t size)
{
    const char *names[16];
    const int   n = hs_kernel_names(names, 16);
    return names[size % (size_t)n];
}

/* Whether entries of the box differ by more than exponents of one scaled box may. */
static bool
is_uneven(const fuzz_scene *f)
{
    double least = INFINITY, largest = f->scene.cutoff;
    for (int e = 0; f->scene.box != NULL && e < f->scene.ndim * f->scene.ndim; e++) {
        const double entry = fabs(f->box.rows[e / f->scene.ndim][e % f->scene.ndim]);
        least = entry > 0.0 ? fmin(least, entry) : least;
        largest = fmax(largest, entry);
    }
    return ldexp(least, 900) < largest;
}

/* What the other kinds of search get wrong; they may refuse what is far away, or more than they can
 * count, where the numbers of the scene are far apart. */
static const char *
other_difference(const fuzz_scene *f, const brute_list *expected, int number, uint64_t salt)
{
    static const hs_status far[] = {HS_ERR_SHIFT_RANGE, HS_ERR_BOX_SKEWED, HS_ERR_FAR,
                                    HS_ERR_MEMORY};
    const char            *difference = answer_difference(number, &f->scene, expected, salt, 1);
    for (int s = 0; difference != NULL && s < 4; s++) {
        if (strcmp(difference, hs_status_text(far[s])) == 0 &&
            (expected->farthest >= 0x1p30 || most_periods(f, false) >= 0x1p44L || is_uneven(f)))
            difference = NULL;
    }
    return difference;
}

int
LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint64_t salt = 1;
    input    in = {data, data + size};
    kernel_to_check = kernel_for(size);
    algorithm_to_check = (hs_algorithm)(size / 8 % HS_ALGORITHM_END);
    fuzz_scene f;
    brute_list expected;
    take_scene(&in, &f);
    const hs_status valid = status_of(&f);
    if (valid != HS_OK || !is_searchable(&f) || !brute_find(&f.scene, MOST_TESTS, &expected)) {
        only_plan(&f, valid);
        return 0;
    }
    const char *difference = pairs_difference(&f.scene, &expected, 1);
    if (difference != NULL && !may_refuse(&f, &expected, difference))
        fail(&f, difference);
    for (size_t b = 0; b < size; b++)
        salt = 31 * salt + data[b];
    for (int number = 0; difference == NULL && number < ANSWER_CHECKS; number++) {
        const char *other = NULL;
        if (FUZZ_ALL_ANSWERS || number == (int)(salt % ANSWER_CHECKS))
            other = other_difference(&f, &expected, number, salt + (uint64_t)number);
        if (other != NULL) {
            fprintf(stderr, "%s: ", answer_checks[number].name);
            fail(&f, other);
        }
    }
    brute_free(&expected);
    return 0;
}
