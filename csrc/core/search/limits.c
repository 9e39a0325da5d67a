/* SPDX-License-Identifier: BSD-3-Clause */
/* limits.c: what a scan compares with is laid out beside the candidates, so that kernels read it as
 * they read coordinates. */
#include "limits.h"

int32_t
hs_limits_rows(const hs_search *search)
{
    const hs_limits *limits = search->limits;
    if (limits->supports != NULL) {
        return hs_support_numbers(search->scene.ndim);
    }
    return limits->table.n_types > 1 ? limits->table.n_types : 1;
}

/* The number in cell order of candidate c, which was put in order or not. */
HS_ALWAYS_INLINE int32_t
number_of(const hs_scanner *scanner, int32_t c)
{
    const hs_block *block = &scanner->block;
    return block->number[scanner->is_ordered ? block->origin[c] : c];
}

/* The limits of each type with the candidates, a row a type. */
static void
lay_out_table(const hs_limit_table *table, const hs_scanner *scanner)
{
    const hs_block *block = &scanner->block;
    for (int32_t row = 0; row < table->n_types; row++) {
        const float *limits = table->near + row * table->n_types;
        float       *to = block->radius + row * block->pitch;
        for (int32_t c = 0; c < block->n; c++) {
            to[c] = limits[table->of_points[number_of(scanner, c)]];
        }
        hs_pad_lanes(to, block->n);
    }
}

static void
lay_out_radii(const float *of_points, const hs_scanner *scanner)
{
    const hs_block *block = &scanner->block;
    for (int32_t c = 0; c < block->n; c++) {
        block->radius[c] = of_points[number_of(scanner, c)];
    }
    hs_pad_lanes(block->radius, block->n);
}

void
hs_limits_set(const hs_scanner *scanner, const hs_limit_form *form, hs_limit_scan *scan)
{
    const hs_limits      *limits = scanner->search->limits;
    const hs_limit_table *table = &limits->table;
    const float          *of_asking = limits->of_asking.near, *of_points = limits->of_points.near;
    const hs_block       *block = &scanner->block;
    const bool            has_table = table->near != NULL;
    *scan = (hs_limit_scan){
        .rule = limits->rule,
        .bound = limits->near_bound,
        .form = *form,
        .of_point = of_asking != NULL ? of_asking + scanner->group.first : NULL,
        .of_block = of_points != NULL || has_table ? block->radius : NULL,
        .row = has_table ? table->of_asking + scanner->group.first : NULL,
        .stride = block->pitch,
    };
    if (has_table) {
        lay_out_table(table, scanner);
    } else if (of_points != NULL) {
        lay_out_radii(of_points, scanner);
    }
}
