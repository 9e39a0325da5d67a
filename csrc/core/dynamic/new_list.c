/* SPDX-License-Identifier: BSD-3-Clause */
/* new_list.c: the checks of options, and lists that are made, copied and emptied. A copy is a new
 * list into which the points of the old one are put, cell after cell; shrinking makes one and keeps
 * it. */
#include "new_list.h"

#include "copy_points.h"
#include "../memory/account.h"

#define LEAST_LENGTH 0x1p-300 /* squares of these and of their quotients are ordinary numbers */
#define MOST_LENGTH  0x1p300
#define MOST_IMAGES  0x1p20

static bool
is_length(double x)
{
    return x >= LEAST_LENGTH && x <= MOST_LENGTH;
}

static hs_status
refuse_length(hs_failure *failure, hs_length_column column, double value)
{
    failure->column = column;
    failure->value = value;
    return HS_ERR_CUTOFF;
}

static hs_status
check_box(const hs_box *box, int ndim, hs_failure *failure)
{
    if (box == NULL) {
        return HS_OK;
    }
    if (box->ndim != ndim) {
        return HS_ERR_ARGUMENT;
    }
    const hs_status status = hs_box_check(box, failure);
    for (int l = 0; status == HS_OK && l < ndim; l++) {
        for (int k = 0; box->periodic[l] && k < ndim; k++) {
            if (box->rows[l][k] != 0.0 && !is_length(fabs(box->rows[l][k]))) {
                return refuse_length(failure, HS_LENGTH_BOX, box->rows[l][k]);
            }
        }
    }
    return status;
}

hs_status
hs_list_check(const hs_dynamic_options *options, hs_failure *failure)
{
    const double radius = options->max_radius;
    if (options->ndim < 1 || options->ndim > HS_MAX_DIM || (int)options->storage < 0 ||
        options->storage > HS_STORE_ALL_PAIRS || !(options->grid_bytes >= 0.0)) {
        return HS_ERR_ARGUMENT;
    }
    if (!is_length(options->cell_size)) {
        return refuse_length(failure, HS_LENGTH_CELL_SIZE, options->cell_size);
    }
    if (radius != 0.0 && !is_length(radius)) {
        return refuse_length(failure, HS_LENGTH_MAX_RADIUS, radius);
    }
    return check_box(options->box, options->ndim, failure);
}

/* Images of a ball that a query may have to look at, as far as its centre does not add to them. */
static double
count_images(const hs_axes *axes, double max_radius)
{
    double n = 1.0;
    for (int k = 0; k < axes->ndim; k++) {
        const hs_axis *axis = &axes->axis[k];
        if (axis->row >= 0) {
            n *= 2.0 * ceil((max_radius + axis->leak) / axis->period) + 1.0;
        }
    }
    return n;
}

/* Sums over the box that bounds of rounding are made of. */
static void
measure_box(hs_dynamic *list)
{
    double least = INFINITY;
    for (int r = 0; r < list->lattice.n_periodic; r++) {
        list->row_error += list->lattice.row_error[r];
        for (int k = 0; k < list->lattice.ndim; k++) {
            list->spread += fabs(list->lattice.rows[r][k]);
        }
    }
    for (int k = 0; k < list->lattice.ndim; k++) {
        list->moves[k] = hs_moves_column(&list->lattice, k);
        least = list->axes.axis[k].row >= 0 ? hs_smaller(list->axes.axis[k].period, least) : least;
    }
    list->most_terms = 0x1p90 * least;
}

hs_status
hs_list_new(const hs_dynamic_options *options, hs_dynamic **list, hs_failure *failure)
{
    const bool  one_cell = options->storage == HS_STORE_ALL_PAIRS;
    hs_dynamic *made = hs_alloc(NULL, HS_FOR_CELLS, 1, sizeof *made);
    if (made == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(made, 0, sizeof *made);
    made->storage = options->storage;
    made->inclusive = options->inclusive;
    made->cell_size = options->cell_size;
    made->max_radius = options->max_radius != 0.0 ? options->max_radius : options->cell_size;
    made->grid_bytes = options->grid_bytes;
    made->has_box = options->box != NULL;
    if (made->has_box) {
        made->box = *options->box;
    }
    hs_lattice_init(options->box, options->ndim, hs_scale_of(0), &made->lattice);
    hs_status status = hs_skew_is_left(&made->lattice) ? HS_ERR_BOX_SKEWED : HS_OK;
    if (status == HS_OK) {
        hs_axes_init(&made->axes, &made->lattice, made->cell_size, one_cell, made->max_radius);
        measure_box(made);
        hs_gate_init(&made->gate);
        if (!(count_images(&made->axes, made->max_radius) <= MOST_IMAGES)) {
            status = refuse_length(failure, HS_LENGTH_MAX_RADIUS, made->max_radius);
        } else if (!hs_offsets_init(&made->offsets, &made->axes, &made->lattice,
                                    made->max_radius)) {
            status = HS_ERR_MEMORY;
        }
    }
    if (status != HS_OK) {
        hs_free(NULL, made);
        return status;
    }
    hs_entries_init(&made->entries, options->ndim, made->lattice.n_periodic > 0);
    hs_cell_table_init(&made->cells, &made->axes, options->storage != HS_STORE_HASH);
    *list = made;
    return HS_OK;
}

static void
free_points(hs_dynamic *list)
{
    hs_entries_free(&list->entries);
    hs_key_map_free(&list->map);
    hs_cell_table_free(&list->cells);
}

void
hs_list_free(hs_dynamic *list)
{
    free_points(list);
    hs_offsets_free(&list->offsets);
    hs_free(NULL, list);
}

hs_status
hs_list_copy(const hs_dynamic *list, hs_dynamic **copy)
{
    const hs_dynamic_options options = {.ndim = list->lattice.ndim,
                                        .box = list->has_box ? &list->box : NULL,
                                        .storage = list->storage,
                                        .cell_size = list->cell_size,
                                        .max_radius = list->max_radius,
                                        .inclusive = list->inclusive,
                                        .grid_bytes = list->grid_bytes};
    hs_failure               ignored;
    hs_dynamic              *made;
    hs_status                status = hs_list_new(&options, &made, &ignored);
    *copy = NULL;
    if (status == HS_OK) {
        status = hs_copy_points(list, made);
        if (status == HS_OK) {
            *copy = made;
        } else {
            hs_list_free(made);
        }
    }
    return status;
}

void
hs_list_clear(hs_dynamic *list)
{
    free_points(list);
    hs_cell_table_init(&list->cells, &list->axes, list->cells.dense);
    list->n_without = 0;
    list->magnitude = 0.0;
}

hs_status
hs_list_shrink(hs_dynamic *list)
{
    hs_dynamic     *copy;
    const hs_status status = hs_list_copy(list, &copy);
    if (status != HS_OK) {
        return status;
    }
    const hs_entries    entries = list->entries;
    const hs_key_map    map = list->map;
    const hs_cell_table cells = list->cells;
    list->entries = copy->entries;
    list->map = copy->map;
    list->cells = copy->cells;
    list->magnitude = copy->magnitude;
    list->changes++;
    copy->entries = entries;
    copy->map = map;
    copy->cells = cells;
    hs_list_free(copy);
    return HS_OK;
}
