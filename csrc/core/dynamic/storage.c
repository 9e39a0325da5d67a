/* SPDX-License-Identifier: BSD-3-Clause */
#include "storage.h"
#include "../memory/memory.h"
#include "../box/wrap.h"

#include <stdlib.h>

/* storage.c: what a list is stored in: blocks of entries, the map from keys to these, the cells
 * along each axis, and the offsets around a cell. */

/* Blocks by size. Those that are free form a list: the first bytes of each say where the next one
 * is. */

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

#define LEAST_HASH_ROWS 16

static void
hash_free(hs_hash *hash)
{
    hs_free(NULL, hash->rows);
    *hash = (hs_hash){0};
}

int64_t
hs_hash_bytes(const hs_hash *hash)
{
    return hash->n_rows * (int64_t)sizeof *hash->rows;
}

/* Adds a row, for which there is room. */
static void
hash_put(const hs_hash *hash, hs_hash_row row)
{
    int64_t r = row.mark & (uint64_t)(hash->n_rows - 1);
    while (hash->rows[r].number != HS_NO_NUMBER) {
        r = (r + 1) & (hash->n_rows - 1);
    }
    hash->rows[r] = row;
}

static void
hash_clear(const hs_hash *hash)
{
    memset(hash->rows, 0xFF, (size_t)hash->n_rows * sizeof *hash->rows);
}

bool
hs_hash_reserve(hs_hash *hash, int64_t n)
{
    hs_hash larger = {.n_rows = hash->n_rows > 0 ? hash->n_rows : LEAST_HASH_ROWS};
    while (n > larger.n_rows / 4 * 3) {
        larger.n_rows *= 2;
    }
    if (larger.n_rows == hash->n_rows) {
        return true;
    }
    larger.rows = hs_alloc(NULL, HS_FOR_ORDER, larger.n_rows, sizeof *larger.rows);
    if (larger.rows == NULL) {
        return false;
    }
    hash_clear(&larger);
    for (int64_t r = 0; r < hash->n_rows; r++) {
        if (hash->rows[r].number != HS_NO_NUMBER) {
            hash_put(&larger, hash->rows[r]);
        }
    }
    hash_free(hash);
    *hash = larger;
    return true;
}

HS_ALWAYS_INLINE bool
holds(const hs_entries *entries, uint32_t place, hs_key key)
{
    const hs_entry_tail *tail = hs_entry_tail_at(entries, place);
    return tail->id == key.id && tail->tag == key.tag;
}

void
hs_key_map_free(hs_key_map *map)
{
    hash_free(&map->hash);
    map->n = 0;
}

uint32_t
hs_key_map_find(const hs_key_map *map, const hs_entries *entries, hs_key key)
{
    const uint32_t mark = hs_key_mark(key);
    const int64_t  last = map->hash.n_rows - 1;
    if (map->n == 0) {
        return HS_NO_PLACE;
    }
    for (int64_t r = mark & (uint64_t)last;; r = (r + 1) & last) {
        const hs_hash_row row = map->hash.rows[r];
        if (row.number == HS_NO_NUMBER || (row.mark == mark && holds(entries, row.number, key))) {
            return row.number;
        }
    }
}

void
hs_key_map_expect(const hs_key_map *map, hs_key key)
{
    HS_PREFETCH_WRITE(&map->hash.rows[hs_key_mark(key) & (uint64_t)(map->hash.n_rows - 1)]);
}

void
hs_key_map_add(hs_key_map *map, hs_key key, uint32_t place)
{
    hash_put(&map->hash, (hs_hash_row){place, hs_key_mark(key)});
    map->n++;
}

/* The row of a key that is there, known by its place. */
static int64_t
row_of(const hs_key_map *map, hs_key key, uint32_t place)
{
    int64_t r = hs_key_mark(key) & (uint64_t)(map->hash.n_rows - 1);
    while (map->hash.rows[r].number != place) {
        r = (r + 1) & (map->hash.n_rows - 1);
    }
    return r;
}

void
hs_key_map_moved(hs_key_map *map, hs_key key, uint32_t from, uint32_t to)
{
    map->hash.rows[row_of(map, key, from)].number = to;
}

void
hs_key_map_remove(hs_key_map *map, hs_key key, uint32_t place)
{
    hs_hash_row *const rows = map->hash.rows;
    const int64_t      last = map->hash.n_rows - 1;
    int64_t            gap = row_of(map, key, place);
    for (int64_t r = (gap + 1) & last; rows[r].number != HS_NO_NUMBER; r = (r + 1) & last) {
        const int64_t home = rows[r].mark & (uint64_t)last;
        if (((r - home) & last) >= ((r - gap) & last)) { /* it may stand in the gap */
            rows[gap] = rows[r];
            gap = r;
        }
    }
    rows[gap].number = HS_NO_NUMBER;
    map->n--;
}

int64_t
hs_repeated_key(const int64_t *ids, const int32_t *tags, int64_t n)
{
    hs_hash seen = {0};
    int64_t repeated = -1, i = 1;
    while (i < n && (ids[i] > ids[i - 1] ||
                     (ids[i] == ids[i - 1] && tags != NULL && tags[i] > tags[i - 1]))) {
        i++;
    }
    if (i >= n) { /* each key is above the one before: no table is needed */
        return -1;
    }
    if (!hs_hash_reserve(&seen, n)) {
        return -2;
    }
    for (i = 0; i < n && repeated < 0; i++) {
        const hs_key   key = {ids[i], tags != NULL ? tags[i] : 0};
        const uint32_t mark = hs_key_mark(key);
        int64_t        r = mark & (uint64_t)(seen.n_rows - 1);
        for (; seen.rows[r].number != HS_NO_NUMBER; r = (r + 1) & (seen.n_rows - 1)) {
            const uint32_t other = seen.rows[r].number;
            if (seen.rows[r].mark == mark && ids[other] == key.id &&
                (tags == NULL || tags[other] == key.tag)) {
                repeated = i;
                break;
            }
        }
        seen.rows[r] = (hs_hash_row){(uint32_t)i, mark};
    }
    hash_free(&seen);
    return repeated;
}

/* Cells of at least the width that was given; periods hold a whole number of them. */

#define MOST_CELLS 0x1p30 /* in a period: their numbers and images are int32 and int64 */

/* Wrapped points are so many rows away at most, where they are far along open axes. */
#define ROWS_AWAY 16

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

/* Sparse tables keep the numbers of their cells when they grow, and close the gaps when they drop
 * empty ones. */

#define MORE_CELLS       16 /* than half as many again, when a table grows */
#define DENSE_CELL_BYTES (sizeof(hs_cell) + sizeof(uint8_t)) /* of a cell of a dense table */

/* Adds the row of a cell, for which there is room. */
static void
put_cell(const hs_cell_table *table, int64_t cell)
{
    uint64_t sum = 0;
    for (int k = 0; k < table->ndim; k++) {
        sum += hs_cell_part(k, table->index[cell * table->ndim + k]);
    }
    hash_put(&table->hash, (hs_hash_row){(uint32_t)cell, hs_cell_mark(sum)});
}

/* Empty cells are dropped; those behind them get lower numbers. */
static void
drop_empty(hs_cell_table *table, hs_entries *entries)
{
    const size_t width = (size_t)table->ndim * sizeof *table->index;
    int64_t      n = 0;
    hash_clear(&table->hash);
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
        put_cell(table, n++);
    }
    table->n = n;
    table->n_empty = 0;
}

/* Room for `capacity` cells and rows for them; on failure some arrays are larger than they must
 * be. */
static bool
grow(hs_cell_table *table, int64_t capacity)
{
    hs_cell *cell = NULL;
    uint8_t *size = NULL;
    int32_t *index = NULL;
    if (hs_hash_reserve(&table->hash, capacity)) {
        cell = hs_grow(NULL, HS_FOR_CELLS, table->cell, table->n, capacity, sizeof *cell);
    }
    if (cell != NULL) {
        table->cell = cell;
        size = hs_grow(NULL, HS_FOR_CELLS, table->size, table->n, capacity, sizeof *size);
    }
    if (size != NULL) {
        table->size = size;
        index = hs_grow(NULL, HS_FOR_CELLS, table->index, table->n, capacity,
                        table->ndim * sizeof *index);
    }
    if (index != NULL) {
        table->index = index;
        table->capacity = capacity;
    }
    return index != NULL;
}

static hs_status
reserve_sparse(hs_cell_table *table, hs_entries *entries, int64_t more)
{
    if (table->n + more <= table->capacity) {
        return HS_OK;
    }
    if (table->n_empty >= table->n / 2 && table->n_empty > 0 && !table->keeps_empty) {
        drop_empty(table, entries);
    }
    int64_t capacity = table->n + table->n / 2 + MORE_CELLS;
    capacity = capacity < table->n + more ? table->n + more : capacity;
    if (table->n + more <= table->capacity ||
        (capacity < (int64_t)HS_NO_CELL && grow(table, capacity))) {
        return HS_OK;
    }
    if (table->n_empty > 0 && !table->keeps_empty) {
        drop_empty(table, entries);
    }
    return table->n + more <= table->capacity ? HS_OK : HS_ERR_MEMORY;
}

/* Cells are found, in either kind of table. */

void
hs_cell_table_init(hs_cell_table *table, const hs_axes *axes, bool dense, double most_bytes)
{
    memset(table, 0, sizeof *table);
    table->dense = dense;
    table->ndim = axes->ndim;
    table->most_bytes = most_bytes;
    for (int k = 0; k < axes->ndim; k++) {
        table->shape[k] = axes->axis[k].n; /* 0: none yet, along open axes */
    }
}

void
hs_cell_table_free(hs_cell_table *table)
{
    hs_free(NULL, table->cell);
    hs_free(NULL, table->size);
    hs_free(NULL, table->index);
    hash_free(&table->hash);
    table->cell = NULL;
    table->size = NULL;
    table->index = NULL;
    table->n = table->capacity = table->n_empty = 0;
}

uint32_t
hs_cell_table_find(const hs_cell_table *table, const int64_t *index)
{
    uint64_t sum = 0;
    for (int k = 0; k < table->ndim; k++) {
        if (table->dense) {
            const int64_t along = index[k] - table->lowest[k];
            if (table->n == 0 || along < 0 || along >= table->shape[k]) {
                return HS_NO_CELL;
            }
            sum += (uint64_t)(along * table->stride[k]);
        } else {
            sum += hs_cell_part(k, index[k]);
        }
    }
    return table->dense ? (uint32_t)sum : hs_cell_table_probe(table, index, hs_cell_mark(sum));
}

hs_status
hs_cell_table_add(hs_cell_table *table, hs_entries *entries, const int64_t *index, uint32_t *number,
                  hs_failure *failure)
{
    *number = hs_cell_table_find(table, index);
    for (int k = 0; k < table->ndim && !table->dense; k++) {
        table->is_wide = table->is_wide || index[k] < INT32_MIN || index[k] > INT32_MAX;
    }
    if (*number != HS_NO_CELL) {
        return HS_OK;
    }
    const hs_status status = hs_cell_table_reserve(table, entries, index, index, 1, failure);
    if (status == HS_OK && table->dense) {
        *number = hs_cell_table_find(table, index);
    } else if (status == HS_OK) {
        *number = (uint32_t)table->n++;
        table->n_empty++;
        table->cell[*number] = (hs_cell){0, 0};
        table->size[*number] = HS_NO_BLOCK;
        for (int k = 0; k < table->ndim; k++) {
            table->index[(int64_t)*number * table->ndim + k] = (int32_t)(uint32_t)index[k];
        }
        put_cell(table, *number);
    }
    return status;
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
    const size_t of_index = table->dense ? 0 : (size_t)table->ndim * sizeof *table->index;
    return table->capacity * (int64_t)(DENSE_CELL_BYTES + of_index) + hs_hash_bytes(&table->hash);
}

/* Dense tables reach farther by being copied into larger ones. */

#define MOST_DENSE_CELLS 0x1p31

/* The shape that holds the present range along each axis and that from `first` to `last`, grown by
 * half of the present one where it grows at all, or `tight`; returns the number of cells. Periodic
 * axes have their range from the beginning. */
static double
join(const hs_cell_table *table, const int64_t *first, const int64_t *last, bool tight,
     hs_cell_table *larger)
{
    double n = 1.0;
    for (int k = table->ndim - 1; k >= 0; k--) { /* the last axis fastest */
        const int64_t more = tight ? 0 : table->shape[k] / 2;
        int64_t       low = first[k], high = last[k];
        if (table->shape[k] > 0) {
            low = table->lowest[k];
            high = low + table->shape[k] - 1;
            low = first[k] < low ? first[k] - more : low;
            high = last[k] > high ? last[k] + more : high;
        }
        larger->lowest[k] = low;
        larger->shape[k] = high - low + 1;
        larger->stride[k] = n < MOST_DENSE_CELLS ? (int64_t)n : 0;
        n *= (double)larger->shape[k];
    }
    return n;
}

/* Moves the cells of a dense table to their places in a larger one. */
static void
transfer(const hs_cell_table *table, hs_entries *entries, const hs_cell_table *larger)
{
    for (int64_t c = 0; c < table->n; c++) {
        int64_t index[HS_MAX_DIM];
        if (table->size[c] == HS_NO_BLOCK) {
            continue;
        }
        hs_cell_table_index(table, (uint32_t)c, index);
        const uint32_t number = hs_cell_table_find(larger, index);
        larger->cell[number] = table->cell[c];
        larger->size[number] = table->size[c];
        for (uint32_t e = 0; e < table->cell[c].count; e++) {
            hs_entry_tail_at(entries, table->cell[c].start + e)->cell = number;
        }
    }
}

static hs_status
reserve_dense(hs_cell_table *table, hs_entries *entries, const int64_t *first, const int64_t *last,
              hs_failure *failure)
{
    hs_cell_table larger = *table;
    if (hs_cell_table_find(table, first) != HS_NO_CELL &&
        hs_cell_table_find(table, last) != HS_NO_CELL) {
        return HS_OK;
    }
    double n = join(table, first, last, false, &larger);
    if (!(n < MOST_DENSE_CELLS && n * DENSE_CELL_BYTES <= table->most_bytes)) {
        n = join(table, first, last, true, &larger);
    }
    if (!(n < MOST_DENSE_CELLS && n * DENSE_CELL_BYTES <= table->most_bytes)) {
        failure->expected_bytes = n * DENSE_CELL_BYTES;
        failure->limit_bytes = table->most_bytes;
        return HS_ERR_CAPACITY;
    }
    larger.n = larger.capacity = (int64_t)n;
    larger.cell = hs_alloc(NULL, HS_FOR_CELLS, larger.n, sizeof *larger.cell);
    larger.size = hs_alloc(NULL, HS_FOR_CELLS, larger.n, sizeof *larger.size);
    if (larger.cell == NULL || larger.size == NULL) {
        hs_free(NULL, larger.cell);
        hs_free(NULL, larger.size);
        return HS_ERR_MEMORY;
    }
    memset(larger.cell, 0, (size_t)n * sizeof *larger.cell);
    memset(larger.size, HS_NO_BLOCK, (size_t)n * sizeof *larger.size);
    transfer(table, entries, &larger);
    hs_cell_table_free(table);
    *table = larger;
    return HS_OK;
}

hs_status
hs_cell_table_reserve(hs_cell_table *table, hs_entries *entries, const int64_t *first,
                      const int64_t *last, int64_t more, hs_failure *failure)
{
    return table->dense ? reserve_dense(table, entries, first, last, failure)
                        : reserve_sparse(table, entries, more);
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

/* The offsets of the list of this reach, in order; `unit` is the widest cell's width. */
static void
fill(const hs_axes *axes, const hs_lattice *lattice, double unit, int reach, item *items,
     const hs_offsets *offsets)
{
    const int     d = axes->ndim, side = 2 * reach + 1;
    const int64_t n = offsets->n[reach];
    for (int64_t i = 0; i < n; i++) {
        int64_t rest = i;
        memset(items[i].slot, 0, sizeof items[i].slot);
        for (int k = d - 1; k >= 0; k--) {
            items[i].slot[k] = (uint8_t)(rest % side + HS_MOST_REACH - reach);
            rest /= side;
        }
        measure(axes, lattice, unit, &items[i]);
    }
    qsort(items, (size_t)n, sizeof *items, compare);
    for (int64_t i = 0; i < n; i++) {
        memcpy(offsets->slot + offsets->at[reach] + i * d, items[i].slot, (size_t)d);
    }
}

bool
hs_offsets_init(hs_offsets *offsets, const hs_axes *axes, const hs_lattice *lattice,
                double max_radius)
{
    double needed = 0.0, unit = 0.0; /* cells to a side, and one more for rounding; widest cell */
    memset(offsets, 0, sizeof *offsets);
    for (int k = 0; k < axes->ndim; k++) {
        if (isfinite(axes->axis[k].width)) {
            needed = hs_larger(ceil(max_radius / axes->axis[k].width) + 1.0, needed);
            unit = hs_larger(axes->axis[k].width, unit);
        }
    }
    for (int r = 0; r <= HS_MOST_REACH && r <= needed; r++) {
        double n = 1.0;
        for (int k = 0; k < axes->ndim; k++) {
            n *= 2 * r + 1;
        }
        if (n > HS_MOST_OFFSETS) {
            break;
        }
        offsets->reach = r;
        offsets->n[r] = (int64_t)n;
        offsets->at[r + 1] = offsets->at[r] + (int64_t)n * axes->ndim;
    }
    const int last = offsets->reach;
    offsets->slot = hs_alloc(NULL, HS_FOR_STENCIL, offsets->at[last + 1], 1);
    item *items = hs_alloc(NULL, HS_FOR_STENCIL, offsets->n[last], sizeof *items);
    for (int r = 0; r <= last && offsets->slot != NULL && items != NULL; r++) {
        fill(axes, lattice, unit > 0.0 ? unit : 1.0, r, items, offsets);
    }
    hs_free(NULL, items);
    if (items == NULL) {
        hs_offsets_free(offsets);
    }
    return offsets->slot != NULL;
}

bool
hs_offsets_copy(const hs_offsets *offsets, hs_offsets *copy)
{
    const int64_t bytes = offsets->at[offsets->reach + 1];
    *copy = *offsets;
    copy->slot = hs_alloc(NULL, HS_FOR_STENCIL, bytes, 1);
    if (copy->slot != NULL) {
        memcpy(copy->slot, offsets->slot, (size_t)bytes);
    }
    return copy->slot != NULL;
}

void
hs_offsets_free(hs_offsets *offsets)
{
    hs_free(NULL, offsets->slot);
    offsets->slot = NULL;
}
