/* SPDX-License-Identifier: BSD-3-Clause */
#include "storage.h"
#include "../memory/memory.h"
#include "../box/wrap.h"

#include <stdlib.h>

/* storage.c: what a list is stored in: blocks of entries, the map from keys to these, the cells
 * along each axis, and the offsets around a cell. */

/* Blocks by size. Those that are free form a list: the first bytes of each say where the
 * next one is. */

#define FIRST_CAPACITY 16
#define MOST_ENTRIES   INT64_C(0xFFFFFFF0) /* places are below HS_NO_PLACE */

void
hs_entries_init(hs_entries *entries, int ndim, bool keeps_given)
{
    memset(entries, 0, sizeof *entries);
    entries->ndim = ndim;
    entries->stride = (size_t)ndim * sizeof(double) + sizeof(hs_entry_tail);
    entries->keeps_given = keeps_given;
    for (int size = 0; size < HS_ENTRY_SIZES; size++) {
        entries->spare[size] = HS_NO_PLACE;
    }
}

void
hs_entries_free(hs_entries *entries)
{
    hs_free(NULL, entries->data);
    hs_free(NULL, entries->given);
    hs_entries_init(entries, entries->ndim, entries->keeps_given);
}

/* Half as many again as there were, at least. */
bool
hs_entries_reserve(hs_entries *entries, int64_t more)
{
    const int64_t needed = entries->n_used + more;
    int64_t       capacity = entries->capacity;
    if (needed <= capacity) {
        return true;
    }
    capacity += capacity / 2;
    capacity = capacity < needed ? needed : capacity;
    capacity = capacity < FIRST_CAPACITY ? FIRST_CAPACITY : capacity;
    capacity = capacity > MOST_ENTRIES ? MOST_ENTRIES : capacity;
    if (needed > capacity) {
        return false;
    }
    if (entries->keeps_given) {
        double *given = hs_grow(NULL, HS_FOR_ORIGINALS, entries->given,
                                (int64_t)entries->n_used * entries->ndim, capacity * entries->ndim,
                                sizeof(double));
        if (given == NULL) {
            return false;
        }
        entries->given = given; /* larger than it must be if the next is refused */
    }
    unsigned char *data =
        hs_grow(NULL, HS_FOR_POINTS, entries->data, entries->n_used, capacity, entries->stride);
    if (data == NULL) {
        return false;
    }
    entries->data = data;
    entries->capacity = (uint32_t)capacity;
    return true;
}

uint32_t
hs_entries_take(hs_entries *entries, int size)
{
    uint32_t place = entries->spare[size];
    if (place != HS_NO_PLACE) {
        memcpy(&entries->spare[size], hs_entry_at(entries, place), sizeof place);
        return place;
    }
    if (!hs_entries_reserve(entries, INT64_C(1) << size)) {
        return HS_NO_PLACE;
    }
    place = entries->n_used;
    entries->n_used += (uint32_t)1 << size;
    return place;
}

void
hs_entries_give(hs_entries *entries, int size, uint32_t place)
{
    memcpy(hs_entry_at(entries, place), &entries->spare[size], sizeof place);
    entries->spare[size] = place;
}

void
hs_entries_copy(const hs_entries *source, uint32_t from, hs_entries *entries, uint32_t to,
                uint32_t n)
{
    memcpy(hs_entry_at(entries, to), hs_entry_at(source, from), n * entries->stride);
    if (entries->keeps_given) {
        memcpy(hs_entry_given(entries, to), hs_entry_given(source, from),
               (size_t)n * (size_t)entries->ndim * sizeof(double));
    }
}

int64_t
hs_entries_bytes(const hs_entries *entries)
{
    const size_t given = entries->keeps_given ? (size_t)entries->ndim * sizeof(double) : 0;
    return (int64_t)entries->capacity * (int64_t)(entries->stride + given);
}

/* Rows stand as near behind the one that their mark names as others allow. */

#define LEAST_KEY_ROWS 16

HS_ALWAYS_INLINE bool
holds(const hs_entries *entries, uint32_t place, hs_key key)
{
    const hs_entry_tail *tail = hs_entry_tail_at(entries, place);
    return tail->id == key.id && tail->tag == key.tag;
}

void
hs_key_map_free(hs_key_map *map)
{
    hs_free(NULL, map->rows);
    *map = (hs_key_map){0};
}

static void
put_key(hs_key_row *rows, int64_t capacity, hs_key_row row)
{
    int64_t r = row.mark & (uint64_t)(capacity - 1);
    while (rows[r].place != HS_NO_PLACE) {
        r = (r + 1) & (capacity - 1);
    }
    rows[r] = row;
}

bool
hs_key_map_reserve(hs_key_map *map, int64_t n)
{
    int64_t capacity = map->capacity > 0 ? map->capacity : LEAST_KEY_ROWS;
    while (n > capacity / 4 * 3) {
        capacity *= 2;
    }
    if (capacity == map->capacity) {
        return true;
    }
    hs_key_row *rows = hs_alloc(NULL, HS_FOR_ORDER, capacity, sizeof *rows);
    if (rows == NULL) {
        return false;
    }
    memset(rows, 0xFF, (size_t)capacity * sizeof *rows);
    for (int64_t r = 0; r < map->capacity; r++) {
        if (map->rows[r].place != HS_NO_PLACE) {
            put_key(rows, capacity, map->rows[r]);
        }
    }
    hs_free(NULL, map->rows);
    map->rows = rows;
    map->capacity = capacity;
    return true;
}

uint32_t
hs_key_map_find(const hs_key_map *map, const hs_entries *entries, hs_key key)
{
    const uint32_t mark = hs_key_mark(key);
    if (map->n == 0) {
        return HS_NO_PLACE;
    }
    for (int64_t r = mark & (uint64_t)(map->capacity - 1);; r = (r + 1) & (map->capacity - 1)) {
        const hs_key_row row = map->rows[r];
        if (row.place == HS_NO_PLACE || (row.mark == mark && holds(entries, row.place, key))) {
            return row.place;
        }
    }
}

void
hs_key_map_expect(const hs_key_map *map, hs_key key)
{
    HS_PREFETCH_WRITE(&map->rows[hs_key_mark(key) & (uint64_t)(map->capacity - 1)]);
}

void
hs_key_map_add(hs_key_map *map, hs_key key, uint32_t place)
{
    put_key(map->rows, map->capacity, (hs_key_row){place, hs_key_mark(key)});
    map->n++;
}

/* The row of a key that is there, known by its place. */
static int64_t
row_of(const hs_key_map *map, hs_key key, uint32_t place)
{
    int64_t r = hs_key_mark(key) & (uint64_t)(map->capacity - 1);
    while (map->rows[r].place != place) {
        r = (r + 1) & (map->capacity - 1);
    }
    return r;
}

void
hs_key_map_moved(hs_key_map *map, hs_key key, uint32_t from, uint32_t to)
{
    map->rows[row_of(map, key, from)].place = to;
}

void
hs_key_map_remove(hs_key_map *map, hs_key key, uint32_t place)
{
    const int64_t last = map->capacity - 1;
    int64_t       gap = row_of(map, key, place);
    for (int64_t r = (gap + 1) & last; map->rows[r].place != HS_NO_PLACE; r = (r + 1) & last) {
        const int64_t home = map->rows[r].mark & (uint64_t)last;
        if (((r - home) & last) >= ((r - gap) & last)) { /* it may stand in the gap */
            map->rows[gap] = map->rows[r];
            gap = r;
        }
    }
    map->rows[gap].place = HS_NO_PLACE;
    map->n--;
}

/* Ascending keys are compared in turn; others are put into a table one by one. */

#define LEAST_SEEN_ROWS 16

/* Whether each key is above the one before: then none is repeated, which no table is needed to see.
 */
static bool
ascend(const int64_t *ids, const int32_t *tags, int64_t n)
{
    bool all = true;
    for (int64_t i = 1; i < n && all; i++) {
        all = ids[i] > ids[i - 1] ||
              (ids[i] == ids[i - 1] && tags != NULL && tags[i] > tags[i - 1]);
    }
    return all;
}

int64_t
hs_repeated_key(const int64_t *ids, const int32_t *tags, int64_t n)
{
    int64_t capacity = LEAST_SEEN_ROWS, repeated = -1;
    if (ascend(ids, tags, n)) {
        return -1;
    }
    while (n > capacity / 2) {
        capacity *= 2;
    }
    hs_key_row *rows = hs_alloc(NULL, HS_FOR_ORDER, capacity, sizeof *rows);
    if (rows == NULL) {
        return -2;
    }
    memset(rows, 0xFF, (size_t)capacity * sizeof *rows);
    for (int64_t i = 0; i < n && repeated < 0; i++) {
        const hs_key   key = {ids[i], tags != NULL ? tags[i] : 0};
        const uint32_t mark = hs_key_mark(key);
        int64_t        r = mark & (uint64_t)(capacity - 1);
        for (; rows[r].place != HS_NO_PLACE; r = (r + 1) & (capacity - 1)) {
            const uint32_t other = rows[r].place;
            if (rows[r].mark == mark && ids[other] == key.id &&
                (tags == NULL || tags[other] == key.tag)) {
                repeated = i;
                break;
            }
        }
        rows[r] = (hs_key_row){(uint32_t)i, mark};
    }
    hs_free(NULL, rows);
    return repeated;
}

/* Cells of at least the width that was given; periods hold a whole number of them. */

#define MOST_CELLS 0x1p30 /* in a period: their numbers and images are int32 and int64 */

/* Wrapped points are so many rows away at most, where they are far along open axes. */
#define ROWS_AWAY 16

bool
hs_moves_column(const hs_lattice *lattice, int c)
{
    bool moves = false;
    for (int l = 0; l < lattice->n_periodic; l++) {
        moves = moves || lattice->given[l][c] != 0.0;
    }
    return moves;
}

/*
 * By how much the images of a ball may miss whole periods along axis k: a row of B that should not
 * move along it does so by normal . row, as rounded, and by the roundings of these; the row that
 * should moves by its height as rounded. So often as a query can meet the row: R and what
 * coordinates are wrong by, in heights. Points that are ROWS_AWAY are rounded besides.
 */
static double
leak_of(const hs_lattice *lattice, int k, double max_radius, const hs_axes *so_far)
{
    double leak = 0.0;
    for (int j = 0; j < lattice->ndim; j++) {
        const int r = lattice->row_of_axis[j];
        double    along = 0.0, size = 0.0;
        if (r < 0) {
            continue;
        }
        for (int c = 0; c < lattice->ndim; c++) {
            along += lattice->normal[k][c] * lattice->rows[r][c];
            size += fabs(lattice->rows[r][c]);
        }
        const double miss =
            (j == k ? 0.0 : fabs(along)) + 0x1p-44 * size + lattice->ndim * lattice->row_error[r];
        leak += ((max_radius + so_far->axis[j].leak) / lattice->period[j] + ROWS_AWAY) * miss;
        leak += hs_axis_rounding(lattice->ndim) * ROWS_AWAY *
                hs_axis_terms(lattice, lattice->rows[r], k);
    }
    return leak;
}

/* Leaks twice: those along one axis lead to more images along others. */
static void
set_leaks(hs_axes *axes, const hs_lattice *lattice, double max_radius)
{
    for (int pass = 0; pass < 2 && !lattice->aligned; pass++) {
        const hs_axes so_far = *axes;
        for (int k = 0; k < lattice->ndim; k++) {
            axes->axis[k].leak = leak_of(lattice, k, max_radius, &so_far);
        }
    }
    for (int k = 0; k < lattice->ndim; k++) {
        hs_axis *axis = &axes->axis[k];
        axis->farthest = axis->row >= 0 ? HS_WRAP_LIMIT * axis->period : INFINITY;
        for (int r = 0; r < lattice->n_periodic; r++) {
            axis->farthest += hs_axis_terms(lattice, lattice->rows[r], k);
        }
    }
}

void
hs_axes_init(hs_axes *axes, const hs_lattice *lattice, double cell_size, bool one_cell,
             double max_radius)
{
    axes->ndim = lattice->ndim;
    axes->aligned = lattice->aligned;
    for (int k = 0; k < lattice->ndim; k++) {
        hs_axis *axis = &axes->axis[k];
        *axis = (hs_axis){.row = lattice->row_of_axis[k]};
        if (axis->row >= 0) {
            const double fitting = one_cell ? 1.0 : floor(lattice->period[k] / cell_size);
            axis->period = lattice->period[k];
            axis->half = 0.5 * axis->period;
            axis->n = (int64_t)hs_larger(hs_smaller(fitting, MOST_CELLS), 1.0);
        }
        if (axis->n == 1 || (axis->n == 0 && one_cell)) {
            axis->width = axis->n == 1 ? axis->period : INFINITY;
            axis->inverse = 0.0;
        } else {
            axis->width = axis->n > 0 ? axis->period / (double)axis->n : cell_size;
            axis->inverse = 1.0 / axis->width;
        }
        const double farthest = one_cell ? 0.0 : HS_FARTHEST_CELL;
        axis->lowest = axis->n > 0 ? 0.0 : -farthest;
        axis->highest = axis->n > 0 ? (double)(axis->n - 1) : farthest;
    }
    set_leaks(axes, lattice, max_radius);
}

/* The number of periods times their length; beyond one it may be rounded, by less than `*slack`. */
static double
shift_of(const hs_axis *axis, int64_t image, double *slack)
{
    const double shift = (double)image * axis->period;
    *slack = image < -1 || image > 1 ? 0x1p-50 * fabs(shift) : 0.0;
    return shift;
}

void
hs_axis_images(const hs_axis *axis, double low, double high, double error, hs_span_of_cells *span)
{
    /* Image m has points from m L - L/2 to m L + L/2, wider by the error; the quotients are rounded
     * by less than the 2^-40 that is added: one image too many is no fault. */
    const double least = floor((low - error) / axis->period + 0.5 - 0x1p-40);
    const double most = floor((high + error) / axis->period + 0.5 + 0x1p-40);
    double       slack;
    HS_ASSERT(least > -0x1p30 && most < 0x1p30); /* hs_list_new and hs_dynamic_place see to that */
    span->least = (int64_t)least - (fabs(least) > 0x1p8);
    span->most = (int64_t)most + (fabs(most) > 0x1p8);
    const double first = hs_below(low, shift_of(axis, span->least, &slack));
    span->first = span->least * axis->n + hs_axis_cell(axis, first - slack);
    const double last = hs_above(high, -shift_of(axis, span->most, &slack));
    span->last = span->most * axis->n + hs_axis_cell(axis, last + slack);
}

/* Sparse tables keep the numbers of their cells when they grow, and close the
 * gaps when they drop empty ones. */

#define LEAST_CELL_ROWS 16

static uint32_t
mark_of(const hs_cell_table *table, uint32_t cell)
{
    uint64_t sum = 0;
    for (int k = 0; k < table->ndim; k++) {
        sum += hs_cell_part(k, table->index[(int64_t)cell * table->ndim + k]);
    }
    return hs_cell_mark(sum);
}

static void
put_cell(hs_cell_row *rows, int64_t n_rows, uint32_t cell, uint32_t mark)
{
    int64_t r = mark & (uint64_t)(n_rows - 1);
    while (rows[r].cell != HS_NO_CELL) {
        r = (r + 1) & (n_rows - 1);
    }
    rows[r] = (hs_cell_row){cell, mark};
}

static void
put_all(const hs_cell_table *table, hs_cell_row *rows, int64_t n_rows)
{
    memset(rows, 0xFF, (size_t)n_rows * sizeof *rows);
    for (int64_t c = 0; c < table->n; c++) {
        put_cell(rows, n_rows, (uint32_t)c, mark_of(table, (uint32_t)c));
    }
}

/* Empty cells are dropped; those behind them get lower numbers. */
static void
drop_empty(hs_cell_table *table, hs_entries *entries)
{
    const size_t width = (size_t)table->ndim * sizeof *table->index;
    int64_t      n = 0;
    for (int64_t c = 0; c < table->n; c++) {
        if (table->cell[c].count == 0) {
            if (table->size[c] != HS_NO_BLOCK) {
                hs_entries_give(entries, table->size[c], table->cell[c].start);
            }
            continue;
        }
        for (uint32_t e = 0; n < c && e < table->cell[c].count; e++) {
            hs_entry_tail_at(entries, table->cell[c].start + e)->cell = (uint32_t)n;
        }
        table->cell[n] = table->cell[c];
        table->size[n] = table->size[c];
        memmove(table->index + n * table->ndim, table->index + c * table->ndim, width);
        n++;
    }
    table->n = n;
    table->n_empty = 0;
    put_all(table, table->rows, table->n_rows);
}

static void
free_arrays(const hs_cell_table *table)
{
    hs_free(NULL, table->cell);
    hs_free(NULL, table->size);
    hs_free(NULL, table->index);
    hs_free(NULL, table->rows);
}

/* Room for `capacity` cells and rows for them; on failure all is as it was. */
static bool
grow(hs_cell_table *table, int64_t capacity)
{
    int64_t n_rows = table->n_rows > 0 ? table->n_rows : LEAST_CELL_ROWS;
    while (capacity > n_rows / 4 * 3) {
        n_rows *= 2;
    }
    hs_cell     *cell = hs_alloc(NULL, HS_FOR_CELLS, capacity, sizeof *cell);
    uint8_t     *size = hs_alloc(NULL, HS_FOR_CELLS, capacity, sizeof *size);
    int32_t     *index = hs_alloc(NULL, HS_FOR_CELLS, capacity, table->ndim * sizeof *index);
    hs_cell_row *rows = hs_alloc(NULL, HS_FOR_CELLS, n_rows, sizeof *rows);
    if (cell == NULL || size == NULL || index == NULL || rows == NULL) {
        hs_free(NULL, cell);
        hs_free(NULL, size);
        hs_free(NULL, index);
        hs_free(NULL, rows);
        return false;
    }
    if (table->n > 0) {
        memcpy(cell, table->cell, (size_t)table->n * sizeof *cell);
        memcpy(size, table->size, (size_t)table->n * sizeof *size);
        memcpy(index, table->index, (size_t)(table->n * table->ndim) * sizeof *index);
    }
    free_arrays(table);
    table->cell = cell;
    table->size = size;
    table->index = index;
    table->rows = rows;
    table->n_rows = n_rows;
    table->capacity = capacity;
    put_all(table, rows, n_rows);
    return true;
}

bool
hs_cell_table_reserve(hs_cell_table *table, hs_entries *entries, int64_t more)
{
    if (table->n + more <= table->capacity) {
        return true;
    }
    if (table->n_empty >= table->n / 2 && table->n_empty > 0) {
        drop_empty(table, entries);
    }
    int64_t capacity = table->n + table->n / 2 + LEAST_CELL_ROWS;
    capacity = capacity < table->n + more ? table->n + more : capacity;
    if (table->n + more <= table->capacity ||
        (capacity < (int64_t)HS_NO_CELL && grow(table, capacity))) {
        return true;
    }
    if (table->n_empty > 0) {
        drop_empty(table, entries);
    }
    return table->n + more <= table->capacity;
}

/* Sparse: adds a cell that is not there, for which there is room. */
static uint32_t
cell_table_append(hs_cell_table *table, const int64_t *index)
{
    const uint32_t cell = (uint32_t)table->n++;
    table->n_empty++;
    table->cell[cell] = (hs_cell){0, 0};
    table->size[cell] = HS_NO_BLOCK;
    for (int k = 0; k < table->ndim; k++) {
        table->index[(int64_t)cell * table->ndim + k] = (int32_t)(uint32_t)index[k];
    }
    put_cell(table->rows, table->n_rows, cell, mark_of(table, cell));
    return cell;
}

/* Cells are found, in either kind of table. */

void
hs_cell_table_init(hs_cell_table *table, const hs_axes *axes, bool dense)
{
    memset(table, 0, sizeof *table);
    table->dense = dense;
    table->ndim = axes->ndim;
    for (int k = 0; k < axes->ndim; k++) {
        table->shape[k] = axes->axis[k].n; /* 0: none yet, along open axes */
    }
}

void
hs_cell_table_free(hs_cell_table *table)
{
    free_arrays(table);
    table->cell = NULL;
    table->size = NULL;
    table->index = NULL;
    table->rows = NULL;
    table->n = table->capacity = table->n_rows = table->n_empty = 0;
}

static uint32_t
find_dense(const hs_cell_table *table, const int64_t *index)
{
    int64_t number = 0;
    for (int k = 0; k < table->ndim; k++) {
        const int64_t along = index[k] - table->lowest[k];
        if (along < 0 || along >= table->shape[k]) {
            return HS_NO_CELL;
        }
        number += along * table->stride[k];
    }
    return table->n > 0 ? (uint32_t)number : HS_NO_CELL;
}

uint32_t
hs_cell_table_find(const hs_cell_table *table, const int64_t *index)
{
    uint64_t sum = 0;
    if (table->dense) {
        return find_dense(table, index);
    }
    for (int k = 0; k < table->ndim; k++) {
        sum += hs_cell_part(k, index[k]);
    }
    return hs_cell_table_probe(table, index, hs_cell_mark(sum));
}

uint32_t
hs_cell_table_add(hs_cell_table *table, hs_entries *entries, const int64_t *index)
{
    const uint32_t found = hs_cell_table_find(table, index);
    for (int k = 0; k < table->ndim; k++) {
        table->is_wide = table->is_wide || index[k] < INT32_MIN || index[k] > INT32_MAX;
    }
    if (found != HS_NO_CELL || table->dense) {
        return found;
    }
    return hs_cell_table_reserve(table, entries, 1) ? cell_table_append(table, index) : HS_NO_CELL;
}

void
hs_cell_table_index(const hs_cell_table *table, uint32_t cell, int64_t *index)
{
    int64_t rest = cell;
    for (int k = 0; k < table->ndim; k++) {
        if (table->dense) {
            index[k] = table->lowest[k] + rest / table->stride[k];
            rest %= table->stride[k];
        } else {
            index[k] = table->index[(int64_t)cell * table->ndim + k];
        }
    }
}

int64_t
hs_cell_table_bytes(const hs_cell_table *table)
{
    int64_t bytes = table->capacity * (int64_t)HS_DENSE_CELL_BYTES;
    if (!table->dense) {
        bytes += table->capacity * table->ndim * (int64_t)sizeof *table->index +
                 table->n_rows * (int64_t)sizeof *table->rows;
    }
    return bytes;
}

/* Dense tables reach farther by being copied into larger ones. */

#define MOST_DENSE_CELLS 0x1p31

/* The number of cells, and how far one along each axis is from the next. */
static double
set_strides(const int64_t *shape, int ndim, int64_t *stride)
{
    double n = 1.0;
    for (int k = ndim - 1; k >= 0; k--) { /* the last axis fastest */
        stride[k] = n < MOST_DENSE_CELLS ? (int64_t)n : 0;
        n *= (double)shape[k];
    }
    return n;
}

/* The range along an axis that holds both, grown by half of the present one where it grows at all.
 * Periodic axes have theirs from the beginning. */
static void
join(const hs_cell_table *table, int k, int64_t first, int64_t last, bool generous, int64_t *lowest,
     int64_t *shape)
{
    const int64_t more = generous ? table->shape[k] / 2 : 0;
    int64_t       low = first, high = last;
    if (table->shape[k] > 0) {
        low = table->lowest[k];
        high = low + table->shape[k] - 1;
        low = first < low ? first - more : low;
        high = last > high ? last + more : high;
    }
    *lowest = low;
    *shape = high - low + 1;
}

/* Moves the old cells to their places in the new ones. */
static void
transfer(hs_cell_table *table, hs_entries *entries, const int64_t *lowest, const int64_t *stride,
         hs_cell *cell, uint8_t *size)
{
    for (int64_t c = 0; c < table->n; c++) {
        int64_t index[HS_MAX_DIM], number = 0;
        if (table->size[c] == HS_NO_BLOCK) {
            continue;
        }
        hs_cell_table_index(table, (uint32_t)c, index);
        for (int k = 0; k < table->ndim; k++) {
            number += (index[k] - lowest[k]) * stride[k];
        }
        cell[number] = table->cell[c];
        size[number] = table->size[c];
        for (uint32_t e = 0; e < cell[number].count; e++) {
            hs_entry_tail_at(entries, cell[number].start + e)->cell = (uint32_t)number;
        }
    }
}

/* Whether the table reaches from `first` to `last` as it is. */
static bool
reaches(const hs_cell_table *table, const int64_t *first, const int64_t *last)
{
    bool all = table->n > 0;
    for (int k = 0; k < table->ndim; k++) {
        all = all && first[k] >= table->lowest[k] && last[k] < table->lowest[k] + table->shape[k];
    }
    return all;
}

hs_status
hs_cell_table_extend(hs_cell_table *table, hs_entries *entries, const int64_t *first,
                     const int64_t *last, double most, double *bytes)
{
    int64_t lowest[HS_MAX_DIM], shape[HS_MAX_DIM], stride[HS_MAX_DIM];
    double  n = 0.0;
    if (reaches(table, first, last)) {
        return HS_OK;
    }
    for (int generous = 1; generous >= 0; generous--) {
        for (int k = 0; k < table->ndim; k++) {
            join(table, k, first[k], last[k], generous == 1, &lowest[k], &shape[k]);
        }
        n = set_strides(shape, table->ndim, stride);
        if (n < MOST_DENSE_CELLS && n * HS_DENSE_CELL_BYTES <= most) {
            break;
        }
    }
    *bytes = n * HS_DENSE_CELL_BYTES;
    if (!(n < MOST_DENSE_CELLS && *bytes <= most)) {
        return HS_ERR_CAPACITY;
    }
    hs_cell *cell = hs_alloc(NULL, HS_FOR_CELLS, (int64_t)n, sizeof *cell);
    uint8_t *size = cell == NULL ? NULL : hs_alloc(NULL, HS_FOR_CELLS, (int64_t)n, sizeof *size);
    if (size == NULL) {
        hs_free(NULL, cell);
        return HS_ERR_MEMORY;
    }
    memset(cell, 0, (size_t)n * sizeof *cell);
    memset(size, HS_NO_BLOCK, (size_t)n * sizeof *size);
    transfer(table, entries, lowest, stride, cell, size);
    hs_free(NULL, table->cell);
    hs_free(NULL, table->size);
    table->cell = cell;
    table->size = size;
    table->n = table->capacity = (int64_t)n;
    memcpy(table->lowest, lowest, sizeof lowest);
    memcpy(table->shape, shape, sizeof shape);
    memcpy(table->stride, stride, sizeof stride);
    return HS_OK;
}

/* The cube of offsets, sorted once when the list is made. */

/* An offset and what it is sorted by. */
typedef struct item {
    double  least, centre;
    uint8_t slot[HS_MAX_DIM];
} item;

static int
compare(const void *one, const void *other)
{
    const item *a = one, *b = other;
    if (a->least != b->least) {
        return a->least < b->least ? -1 : 1;
    }
    if (a->centre != b->centre) {
        return a->centre < b->centre ? -1 : 1;
    }
    return memcmp(a->slot, b->slot, HS_MAX_DIM);
}

/* Cells to a side that a ball of this radius may reach, and one more for rounding. */
static double
reach_of(const hs_axes *axes, double max_radius)
{
    double reach = 0.0;
    for (int k = 0; k < axes->ndim; k++) {
        const hs_axis *axis = &axes->axis[k];
        if (isfinite(axis->width)) {
            reach = hs_larger(ceil(max_radius / axis->width) + 1.0, reach);
        }
    }
    return reach;
}

static double
count_of(int reach, int ndim)
{
    double n = 1.0;
    for (int k = 0; k < ndim; k++) {
        n *= 2 * reach + 1;
    }
    return n;
}

/* Distances in units of the widest cell, so that their squares are ordinary numbers. In skewed
 * boxes the least distance is the sum of squares of those between faces: an order, not a bound. */
static void
measure(const hs_axes *axes, const hs_lattice *lattice, double unit, item *of)
{
    double centre[HS_MAX_DIM] = {0};
    of->least = of->centre = 0.0;
    for (int k = 0; k < axes->ndim; k++) {
        const int    offset = of->slot[k] - HS_MOST_REACH;
        const int    between = offset > 1 ? offset - 1 : offset < -1 ? -offset - 1 : 0;
        const double width = isfinite(axes->axis[k].width) ? axes->axis[k].width / unit : 0.0;
        of->least += between * width * (between * width);
        for (int c = 0; c < axes->ndim; c++) {
            centre[c] += offset * width * lattice->direction[k][c];
        }
    }
    for (int c = 0; c < axes->ndim; c++) {
        of->centre += centre[c] * centre[c];
    }
}

static void
fill(const hs_axes *axes, const hs_lattice *lattice, int reach, item *items, hs_offset_list *list)
{
    const int d = axes->ndim, side = 2 * reach + 1;
    double    unit = 0.0;
    for (int k = 0; k < d; k++) {
        unit = hs_larger(isfinite(axes->axis[k].width) ? axes->axis[k].width : 0.0, unit);
    }
    for (int64_t n = 0; n < list->n; n++) {
        int64_t rest = n;
        memset(items[n].slot, 0, sizeof items[n].slot);
        for (int k = d - 1; k >= 0; k--) {
            items[n].slot[k] = (uint8_t)(rest % side + HS_MOST_REACH - reach);
            rest /= side;
        }
        measure(axes, lattice, unit > 0.0 ? unit : 1.0, &items[n]);
    }
    qsort(items, (size_t)list->n, sizeof *items, compare);
    for (int64_t n = 0; n < list->n; n++) {
        memcpy(list->slot + n * d, items[n].slot, (size_t)d);
    }
}

bool
hs_offsets_init(hs_offsets *offsets, const hs_axes *axes, const hs_lattice *lattice,
                double max_radius)
{
    const double needed = reach_of(axes, max_radius);
    int64_t      total = 0;
    memset(offsets, 0, sizeof *offsets);
    for (int r = 0; r <= HS_MOST_REACH && r <= needed; r++) {
        const double n = count_of(r, axes->ndim);
        if (n > HS_MOST_OFFSETS) {
            break;
        }
        offsets->reach = r;
        offsets->list[r].n = (int64_t)n;
        total += (int64_t)n * axes->ndim;
    }
    offsets->data = hs_alloc(NULL, HS_FOR_STENCIL, total, 1);
    item *items = hs_alloc(NULL, HS_FOR_STENCIL, offsets->list[offsets->reach].n, sizeof *items);
    if (offsets->data == NULL || items == NULL) {
        hs_free(NULL, items);
        hs_offsets_free(offsets);
        return false;
    }
    offsets->bytes = total;
    total = 0;
    for (int r = 0; r <= offsets->reach; r++) {
        offsets->list[r].slot = offsets->data + total;
        fill(axes, lattice, r, items, &offsets->list[r]);
        total += offsets->list[r].n * axes->ndim;
    }
    hs_free(NULL, items);
    return true;
}

void
hs_offsets_free(hs_offsets *offsets)
{
    hs_free(NULL, offsets->data);
    offsets->data = NULL;
}
