/* SPDX-License-Identifier: BSD-3-Clause */
/* form.c: thresholds for rounded extents, so that there are few of them, each computed once. */
#include "form.h"

#include <math.h>

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
    form->expanded = hs_expanded_of(scene->ndim, scene->cutoff, extent, error);
    if (scene->extreme) {
        const double low = scene->cutoff_low;
        form->direct.in = low > 0.0 ? hs_thresholds_of(scene->ndim, low, extent, error).in : -1.0f;
        form->expanded.in = low > 0.0 ? hs_expanded_of(scene->ndim, low, extent, error).in
                                      : -INFINITY;
    }
}

static void
set_form(const hs_scanner *scanner, hs_form *form)
{
    const hs_kernel *kernel = scanner->search->call->kernel;
    const bool       counts = scanner->use == HS_BLOCK_COUNTS;
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
    } else if (scanner->use == HS_BLOCK_LISTS_SQUARES) {
        form->scan = kernel->squares;
    } else if (hs_expanded_pays(scanner->search->scene.cutoff, form->extent)) {
        form->scan = counts ? kernel->count : kernel->list;
    }
}

/* The form for |y_k| and |q_k| up to the float of these bits. */
static const hs_form *
form_of(hs_scanner *scanner, uint32_t bits)
{
    const uint32_t rounded = hs_extent_bits(bits);
    const double   extent = 2.0 * (double)hs_float_of_bits(rounded);
    hs_form       *form = &scanner->forms[(rounded >> HS_EXTENT_SHIFT) % HS_FORMS];
    if (form->extent != extent) { /* nor for NaN, with which nothing is sure */
        form->extent = extent;
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

void
hs_form_prune(hs_scanner *scanner)
{
    const hs_search *search = scanner->search;
    hs_group        *group = &scanner->group;
    const double     largest = (double)hs_group_bound(hs_search_asking(search), group);
    const double     extent = hs_reach_extent(search->scene.cutoff, largest, search->filter_error);
    const float      half = (float)(0.5 * extent * (1.0 + 0x1p-23)); /* no less, when rounded */
    /* Otherwise y might not be a float. Own points are kept whatever the threshold is. */
    if (half < 0x1p100f) {
        group->near.out = fmaxf(form_of(scanner, hs_bits_of_float(half))->direct.out, 0.0f);
    }
}
