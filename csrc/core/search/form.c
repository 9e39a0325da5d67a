/* SPDX-License-Identifier: BSD-3-Clause */
/* form.c: thresholds for rounded extents, so that there are few of them, each computed once. */
#include "form.h"

#include "limits.h"

#include <math.h>

/* Candidates from which on those are left out that are far from the whole group: with fewer that
 * costs what it saves. Fewer will do for a group whose pairs reach less far than the cutoff. */
#ifdef HS_TESTING
#define WORTH_PRUNING      24 /* so that small scenes have both */
#define WORTH_PRUNING_MORE 8
#else
#define WORTH_PRUNING      300
#define WORTH_PRUNING_MORE 64
#endif
#define SHORTER 0.85 /* of the cutoff: half of its ball, about */

/* Thresholds of one float32 comparison: no hit is unsure. */
static void
set_single(const hs_scanner *scanner, hs_form *form)
{
    const double cutoff = scanner->search->scene.cutoff;
    const float  square = (float)(cutoff * cutoff);
    form->direct.out = scanner->options.inclusive ? square : nextafterf(square, -1.0f);
    form->direct.in = INFINITY;
    form->limits = (hs_limit_form){1.0f, 0.0f, 1.0f, 0.0f};
}

/* A scaled cutoff may be known between bounds only. */
static void
set_thresholds(const hs_scanner *scanner, hs_form *form)
{
    const hs_scene *scene = &scanner->search->scene;
    const double    extent = form->extent, error = scanner->search->filter_error;
    form->direct = hs_thresholds_of(scene->ndim, scene->cutoff, extent, error);
    if (scene->extreme) {
        const double low = scene->cutoff_low;
        form->direct.in = low > 0.0 ? hs_thresholds_of(scene->ndim, low, extent, error).in : -1.0f;
    }
}

static void
set_expanded(const hs_scanner *scanner, hs_form *form)
{
    const hs_scene *scene = &scanner->search->scene;
    const double    extent = form->extent, error = scanner->search->filter_error;
    form->expanded = hs_expanded_of(scene->ndim, scene->cutoff, extent, error);
    if (scene->extreme) {
        const double low = scene->cutoff_low;
        form->expanded.in = low > 0.0 ? hs_expanded_of(scene->ndim, low, extent, error).in
                                      : -INFINITY;
    }
}

/* As in all precisions: what the filter leaves is decided by a fixed formula. */
static void
set_support_form(const hs_scanner *scanner, hs_form *form)
{
    const hs_kernel *kernel = scanner->search->call->kernel;
    const bool       counts = scanner->scans == HS_BLOCK_COUNTS;
    form->scan = counts ? kernel->count_supports : kernel->list_supports;
    set_thresholds(scanner, form);
    form->limits = hs_support_form_of(scanner->search->scene.ndim, form->extent,
                                      scanner->search->filter_error);
}

static void
set_form(const hs_scanner *scanner, hs_form *form)
{
    const hs_kernel *kernel = scanner->search->call->kernel;
    const bool       counts = scanner->scans == HS_BLOCK_COUNTS;
    form->expanded = (hs_expanded){0.0, 0.0}; /* unless it pays */
    if (scanner->search->limits != NULL && scanner->search->limits->supports != NULL) {
        set_support_form(scanner, form);
        return;
    }
    form->scan = counts ? kernel->count_direct : kernel->list_direct;
    if (scanner->search->limits != NULL) {
        form->scan = counts ? kernel->count_limits : kernel->list_limits;
    }
    if (scanner->options.precision == HS_SINGLE) {
        set_single(scanner, form);
        return;
    }
    set_thresholds(scanner, form);
    if (scanner->search->limits != NULL) {
        form->limits = hs_limit_form_of(scanner->search->scene.ndim, form->extent,
                                        scanner->search->filter_error);
    } else if (scanner->scans == HS_BLOCK_LISTS_SQUARES) {
        form->scan = kernel->squares;
    } else if (hs_expanded_pays(scanner->search->scene.cutoff, form->extent)) {
        form->scan = counts ? kernel->count : kernel->list;
        set_expanded(scanner, form);
    }
}

/* Whether it was set for this extent, which NaN never is, and for all else that differs between the
 * searches of a walker. */
static bool
is_form_of(const hs_search *search, double extent, const hs_form *form)
{
    return form->extent == extent && form->cutoff == search->scene.cutoff &&
           form->cutoff_low == search->scene.cutoff_low && form->error == search->filter_error &&
           form->is_extreme == search->scene.extreme;
}

/* The form for |y_k| and |q_k| up to the float of these bits. */
static const hs_form *
form_of(hs_scanner *scanner, uint32_t bits)
{
    const uint32_t rounded = hs_extent_bits(bits);
    const double   extent = 2.0 * (double)hs_float_of_bits(rounded);
    hs_form       *form = &scanner->forms[(rounded >> HS_EXTENT_SHIFT) % HS_FORMS];
    if (!is_form_of(scanner->search, extent, form)) {
        form->extent = extent;
        form->cutoff = scanner->search->scene.cutoff;
        form->cutoff_low = scanner->search->scene.cutoff_low;
        form->error = scanner->search->filter_error;
        form->is_extreme = scanner->search->scene.extreme;
        set_form(scanner, form);
    }
    return form;
}

void
hs_forms_init(hs_scanner *scanner)
{
    for (int f = 0; f < HS_FORMS; f++) {
        scanner->forms[f].extent = -1.0;
    }
}

void
hs_form_set(hs_scanner *scanner)
{
    scanner->form = form_of(scanner, scanner->group.largest);
}

/* A length that no pair of the group is compared with more than: that of its radii, where those of
 * all points do not make it as long as the cutoff. */
static double
group_cutoff(const hs_scanner *scanner)
{
    const hs_limits *limits = scanner->search->limits;
    const double     cutoff = scanner->search->scene.cutoff;
    if (limits == NULL || (limits->of_asking.near == NULL && limits->of_points.near == NULL)) {
        return cutoff;
    }
    float asking = 0.0f;
    for (int32_t si = scanner->group.first;
         limits->of_asking.near != NULL && si < scanner->group.last; si++) {
        asking = fmaxf(asking, limits->of_asking.near[si]);
    }
    const hs_dw limit = hs_limit_by(limits->rule, 1.0, (double)asking,
                                    (double)limits->of_points.most, (double)limits->near_bound);
    /* More than what float32 and a sum have lost. */
    return hs_smaller((limit.hi + 0x1p-20 * cutoff) * (1.0 + 0x1p-20), cutoff);
}

void
hs_form_prune(hs_scanner *scanner)
{
    const hs_search *search = scanner->search;
    hs_group        *group = &scanner->group;
    const double     cutoff = group_cutoff(scanner), error = search->filter_error;
    const bool       is_shorter = cutoff < SHORTER * search->scene.cutoff;
    if (scanner->block.n < (is_shorter ? WORTH_PRUNING_MORE : WORTH_PRUNING)) {
        return;
    }
    const double largest = (double)hs_group_bound(hs_search_asking(search), group);
    const double extent = hs_reach_extent(search->scene.cutoff, largest, error);
    const float  half = (float)(0.5 * extent * (1.0 + 0x1p-23)); /* no less, when rounded */
    /* Otherwise y might not be a float. Own points are kept whatever the threshold is. */
    if (half < 0x1p100f) {
        const hs_form *form = form_of(scanner, hs_bits_of_float(half));
        const float    out =
            is_shorter ? hs_thresholds_of(search->scene.ndim, cutoff, form->extent, error).out
                          : form->direct.out;
        group->near.out = fmaxf(out, 0.0f);
    }
}
