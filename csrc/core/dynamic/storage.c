/* SPDX-License-Identifier: BSD-3-Clause */
#include "dynamic.h"
#include "../base/sort.h"
#include "../memory/memory.h"
#include "../scene/points.h"

/* storage.c: points in their cells: blocks of entries, the map from keys to these, and tables of
 * cells that are dense, or hold occupied cells only; and the functions of halfshell_dynamic.h that
 * let points come, go and move, and copy them. What changes them either does all that it is for, or
 * returns a status and leaves the list as it was, but for memory that waits for the next point. */

#define FIRST_CAPACITY 16
#define MOST_ENTRIES   INT64_C(0xFFFFFFF0) /* places are below HS_NO_PLACE */

void
hs_stored_init(hs_dynamic *list, bool dense, double most_bytes)
{
    const int    ndim = list->lattice.ndim;
    const bool   keeps_given = list->lattice.n_periodic > 0;
    const size_t numbers = (size_t)ndim * (keeps_given ? 2 : 1) * sizeof(double);
    list->entries = (hs_entries){
        .ndim = ndim, .stride = numbers + sizeof(hs_entry_tail), .keeps_given = keeps_given};
    for (int size = 0; size < HS_ENTRY_SIZES; size++) {
        list->entries.spare[size] = HS_NO_PLACE;
    }
    list->map = (hs_hash){0};
    list->cells = (hs_cell_table){.dense = dense, .ndim = ndim, .most_bytes = most_bytes};
    for (int k = 0; k < ndim; k++) {
        list->cells.shape[k] = list->axis[k].n; /* 0: none yet, along open axes */
    }
    list->n_without = 0;
    list->magnitude = 0.0;
}

void
hs_stored_free(hs_dynamic *list)
{
    void *const owned[] = {list->entries.data, list->map.rows,    list->cells.cell,
                           list->cells.size,   list->cells.index, list->cells.hash.rows};
    for (size_t k = 0; k < sizeof owned / sizeof owned[0]; k++) {
        hs_free(NULL, owned[k]);
    }
    hs_stored_init(list, list->cells.dense, list->cells.most_bytes);
}

/* ---- blocks by size: those that are free form a list, in which the first bytes of each say where
 * the next one is ---- */

/* Makes room for `more` entries in blocks to come: half as many again as there were, at least, but
 * exactly so many where there were none. False when memory is refused: then nothing has changed. */
static bool
reserve_entries(hs_entries *entries, int64_t more)
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
    unsigned char *data =
        hs_grow(NULL, HS_FOR_POINTS, entries->data, entries->n_used, capacity, entries->stride);
    if (data == NULL) {
        return false;
    }
    entries->data = data;
    entries->capacity = (uint32_t)capacity;
    return true;
}

/* The first place of a block of 2^size entries, or HS_NO_PLACE. */
static uint32_t
take_block(hs_entries *entries, int size)
{
    uint32_t place = entries->spare[size];
    if (place != HS_NO_PLACE) {
        memcpy(&entries->spare[size], hs_entry_at(entries, place), sizeof place);
        return place;
    }
    if (!reserve_entries(entries, INT64_C(1) << size)) {
        return HS_NO_PLACE;
    }
    place = entries->n_used;
    entries->n_used += (uint32_t)1 << size;
    return place;
}

static void
give_block(hs_entries *entries, int size, uint32_t place)
{
    memcpy(hs_entry_at(entries, place), &entries->spare[size], sizeof place);
    entries->spare[size] = place;
}

/* Copies n entries to other places, also of other entries of the same kind. */
static void
copy_entries(const hs_entries *source, uint32_t from, hs_entries *entries, uint32_t to, uint32_t n)
{
    memcpy(hs_entry_at(entries, to), hs_entry_at(source, from), n * entries->stride);
}

/* ---- hash tables: rows stand as near behind the one that their mark names as others allow ---- */

#define LEAST_HASH_ROWS 16

/* Adds a row, for which there is room. */
static void
hash_put(hs_hash *hash, hs_hash_row row)
{
    int64_t r = row.mark & (uint64_t)(hash->n_rows - 1);
    while (hash->rows[r].number != HS_NO_NUMBER) {
        r = (r + 1) & (hash->n_rows - 1);
    }
    hash->rows[r] = row;
    hash->n++;
}

static void
hash_clear(hs_hash *hash)
{
    memset(hash->rows, 0xFF, (size_t)hash->n_rows * sizeof *hash->rows);
    hash->n = 0;
}

/* Room for n numbers in all; false when memory is refused: then nothing has changed. */
static bool
reserve_rows(hs_hash *hash, int64_t n)
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
    hs_free(NULL, hash->rows);
    *hash = larger;
    return true;
}

/* The row of a number under this mark. */
static int64_t
row_of(const hs_hash *hash, uint32_t mark, uint32_t number)
{
    int64_t r = mark & (uint64_t)(hash->n_rows - 1);
    while (hash->rows[r].number != number) {
        r = (r + 1) & (hash->n_rows - 1);
    }
    return r;
}

/* ---- from a key to the place of its entry, which holds the key itself ---- */

/* Bits of a key in which each depends on all of it: the finaliser of SplitMix64 (Steele, Lea and
 * Flood, OOPSLA 2014). */
HS_ALWAYS_INLINE uint32_t
key_mark(hs_key key)
{
    uint64_t x = (uint64_t)key.id + (uint64_t)(uint32_t)key.tag * UINT64_C(0x9E3779B97F4A7C15);
    x = (x ^ (x >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    x = (x ^ (x >> 27)) * UINT64_C(0x94D049BB133111EB);
    return (uint32_t)(x >> 32);
}

HS_ALWAYS_INLINE hs_key
key_at(const int64_t *ids, const int32_t *tags, int64_t i)
{
    return (hs_key){ids[i], tags != NULL ? tags[i] : 0};
}

uint32_t
hs_stored_find(const hs_dynamic *list, hs_key key)
{
    const uint32_t mark = key_mark(key);
    int64_t        r = mark;
    for (;;) {
        const uint32_t place = hs_hash_next(&list->map, mark, &r);
        if (place == HS_NO_PLACE) {
            return place;
        }
        const hs_entry_tail *tail = hs_entry_tail_at(&list->entries, place);
        if (tail->id == key.id && tail->tag == key.tag) {
            return place;
        }
    }
}

/* An entry was at `from`, and is at `to` now. */
static void
tell_moved(hs_dynamic *list, uint32_t from, uint32_t to)
{
    const hs_entry_tail *tail = hs_entry_tail_at(&list->entries, to);
    const uint32_t       mark = key_mark((hs_key){tail->id, tail->tag});
    list->map.rows[row_of(&list->map, mark, from)].number = to;
}

/* HS_ERR_KEY for a key that comes twice among n, or must be there and is not; HS_ERR_MEMORY. tags:
 * or NULL. */
static hs_status
check_keys(const hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t n,
           bool must_be_there, hs_failure *failure)
{
    hs_hash   seen = {0};
    hs_status status = HS_OK;
    int64_t   i = 1;
    while (i < n && (ids[i] > ids[i - 1] ||
                     (ids[i] == ids[i - 1] && tags != NULL && tags[i] > tags[i - 1]))) {
        i++;
    }
    const bool ascend = i >= n; /* each key is above the one before: no table is needed */
    if (!ascend && !reserve_rows(&seen, n)) {
        return HS_ERR_MEMORY;
    }
    for (i = 0; !ascend && status == HS_OK && i < n; i++) {
        const uint32_t mark = key_mark(key_at(ids, tags, i));
        int64_t        r = mark;
        uint32_t       other = hs_hash_next(&seen, mark, &r);
        while (other != HS_NO_NUMBER &&
               (ids[other] != ids[i] || (tags != NULL && tags[other] != tags[i]))) {
            other = hs_hash_next(&seen, mark, &r);
        }
        if (other != HS_NO_NUMBER) {
            failure->row = i;
            failure->column = HS_KEY_REPEATED;
            status = HS_ERR_KEY;
        }
        hash_put(&seen, (hs_hash_row){(uint32_t)i, mark});
    }
    hs_free(NULL, seen.rows);
    for (i = 0; must_be_there && status == HS_OK && i < n; i++) {
        if (hs_stored_find(list, key_at(ids, tags, i)) == HS_NO_PLACE) {
            failure->row = i;
            failure->column = HS_KEY_ABSENT;
            status = HS_ERR_KEY;
        }
    }
    return status;
}

/* ---- cells: sparse tables keep the numbers of their cells when they grow, and close the gaps when
 * they drop empty ones; dense ones reach farther by being copied into larger ones ---- */

#define MORE_CELLS       16 /* than half as many again, when a table grows */
#define DENSE_CELL_BYTES (sizeof(hs_cell) + sizeof(uint8_t)) /* of a cell of a dense table */
#define MOST_DENSE_CELLS 0x1p31

/* Adds the row of a cell, for which there is room. */
static void
put_cell(hs_cell_table *table, int64_t cell)
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
            continue; /* it has no block: keeps_empty */
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

/* The cell with these indices, or HS_NO_CELL. */
static uint32_t
find_cell(const hs_cell_table *table, const int64_t *index)
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

/* The indices of a cell, in sparse tables modulo 2^32. */
static void
index_of(const hs_cell_table *table, uint32_t cell, int64_t *index)
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

/* Room for `capacity` cells and rows for them; on failure some arrays are larger than they must
 * be. */
static bool
grow(hs_cell_table *table, int64_t capacity)
{
    const size_t width = (size_t)table->ndim * sizeof *table->index;
    hs_cell     *cell =
        hs_grow(NULL, HS_FOR_CELLS, table->cell, table->n, capacity, sizeof *table->cell);
    table->cell = cell != NULL ? cell : table->cell;
    uint8_t *size = hs_grow(NULL, HS_FOR_CELLS, table->size, table->n, capacity, sizeof *size);
    table->size = size != NULL ? size : table->size;
    int32_t *index = hs_grow(NULL, HS_FOR_CELLS, table->index, table->n, capacity, width);
    table->index = index != NULL ? index : table->index;
    if (cell == NULL || size == NULL || index == NULL || !reserve_rows(&table->hash, capacity)) {
        return false;
    }
    table->capacity = capacity;
    return true;
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

static hs_status
reserve_dense(hs_cell_table *table, hs_entries *entries, const int64_t *first, const int64_t *last,
              hs_failure *failure)
{
    hs_cell_table larger = *table;
    if (find_cell(table, first) != HS_NO_CELL && find_cell(table, last) != HS_NO_CELL) {
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
    for (int64_t c = 0; c < table->n; c++) {
        int64_t index[HS_MAX_DIM];
        if (table->size[c] == HS_NO_BLOCK) {
            continue;
        }
        index_of(table, (uint32_t)c, index);
        const uint32_t number = find_cell(&larger, index);
        larger.cell[number] = table->cell[c];
        larger.size[number] = table->size[c];
        for (uint32_t e = 0; e < table->cell[c].count; e++) {
            hs_entry_tail_at(entries, table->cell[c].start + e)->cell = number;
        }
    }
    hs_free(NULL, table->cell);
    hs_free(NULL, table->size);
    *table = larger;
    return HS_OK;
}

/*
 * Makes room for cells to come; the numbers of others may change, and entries get those of theirs.
 * Sparse: for so many more. Dense: makes the table reach from `first` to `last` along open axes;
 * farther than that by half of what it was, if its most bytes allow it. HS_ERR_MEMORY, or
 * HS_ERR_CAPACITY, which sets expected_bytes and limit_bytes: then nothing has changed.
 */
static hs_status
reserve_cells(hs_dynamic *list, const int64_t *first, const int64_t *last, int64_t more,
              hs_failure *failure)
{
    return list->cells.dense ? reserve_dense(&list->cells, &list->entries, first, last, failure)
                             : reserve_sparse(&list->cells, &list->entries, more);
}

/* The number of the cell with these indices; where there is none, it is added. Statuses and effects
 * of reserve_cells. */
static hs_status
add_cell(hs_dynamic *list, const int64_t *index, uint32_t *number, hs_failure *failure)
{
    hs_cell_table *table = &list->cells;
    *number = find_cell(table, index);
    for (int k = 0; k < table->ndim && !table->dense; k++) {
        table->is_wide = table->is_wide || index[k] < INT32_MIN || index[k] > INT32_MAX;
    }
    if (*number != HS_NO_CELL) {
        return HS_OK;
    }
    const hs_status status = reserve_cells(list, index, index, 1, failure);
    if (status == HS_OK && table->dense) {
        *number = find_cell(table, index);
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

/* The size of the smallest block for so many entries: it has 2^size. */
static int
block_size(int64_t count)
{
    int size = 0;
    while (INT64_C(1) << size < count) {
        size++;
    }
    return size;
}

/* Makes room for `more` entries in a cell; those that are there move to a larger block. False when
 * memory is refused: then nothing has changed. */
static bool
reserve_in_cell(hs_dynamic *list, uint32_t number, int64_t more)
{
    hs_cell *const cell = &list->cells.cell[number];
    uint8_t *const size = &list->cells.size[number];
    const int      larger = block_size((int64_t)cell->count + more);
    if (*size != HS_NO_BLOCK && larger <= *size) {
        return true;
    }
    const uint32_t place = larger < HS_ENTRY_SIZES ? take_block(&list->entries, larger)
                                                   : HS_NO_PLACE;
    if (place == HS_NO_PLACE) {
        return false;
    }
    for (uint32_t e = 0; e < cell->count; e++) {
        copy_entries(&list->entries, cell->start + e, &list->entries, place + e, 1);
        tell_moved(list, cell->start + e, place + e);
    }
    if (*size != HS_NO_BLOCK) {
        give_block(&list->entries, *size, cell->start);
    }
    cell->start = place;
    *size = (uint8_t)larger;
    return true;
}

/*
 * ---- a point comes into a cell, goes out of it or moves on, once there is room: nothing here can
 * fail. A point that stays in its cell is written over; else it is appended to its new cell and
 * taken out of the old one ----
 */

/* In line: a call of memcpy for two or three numbers takes longer than they do. */
HS_ALWAYS_INLINE void
copy_numbers(double *to, const double *from, int n)
{
    for (int k = 0; k < n; k++) {
        to[k] = from[k];
    }
}

/* The position of an entry. placed: NULL for a key without one. */
static void
write_entry(hs_dynamic *list, uint32_t place, const hs_placed *placed)
{
    const int     d = list->lattice.ndim;
    double *const x = hs_entry_at(&list->entries, place);
    if (placed == NULL) {
        for (int k = 0; k < d; k++) {
            x[k] = NAN;
        }
        return;
    }
    copy_numbers(x, placed->x, d);
    if (list->entries.keeps_given) {
        copy_numbers(hs_entry_given(&list->entries, place), placed->given, d);
    }
    if (!list->lattice.aligned) {
        list->magnitude = hs_larger(placed->magnitude, list->magnitude);
    }
}

/* Takes an entry out of its cell: the last one takes its place. A cell that is left empty gives its
 * block back. */
HS_ALWAYS_INLINE void
take_out(hs_dynamic *list, uint32_t place)
{
    const uint32_t number = hs_entry_tail_at(&list->entries, place)->cell;
    hs_cell *const cell = &list->cells.cell[number];
    const uint32_t last = cell->start + cell->count - 1;
    if (last != place) {
        copy_entries(&list->entries, last, &list->entries, place, 1);
        tell_moved(list, last, place);
    }
    cell->count--;
    list->cells.n_empty += cell->count == 0;
    if (cell->count == 0 && !list->cells.keeps_empty) {
        give_block(&list->entries, list->cells.size[number], cell->start);
        list->cells.size[number] = HS_NO_BLOCK;
    }
}

HS_ALWAYS_INLINE bool
has_position(const hs_dynamic *list, uint32_t place)
{
    return !isnan(hs_entry_at(&list->entries, place)[0]);
}

/* The point of a key, which is at `place`, or HS_NO_PLACE; its cell has room for it, if it is not
 * there already. */
HS_ALWAYS_INLINE void
put_point(hs_dynamic *list, hs_key key, uint32_t place, uint32_t number, const hs_placed *placed)
{
    const bool is_new = place == HS_NO_PLACE;
    list->n_without += (placed == NULL) - (!is_new && !has_position(list, place));
    if (!is_new && hs_entry_tail_at(&list->entries, place)->cell == number) {
        write_entry(list, place, placed);
        return;
    }
    hs_cell *const cell = &list->cells.cell[number];
    const uint32_t to = cell->start + cell->count++;
    list->cells.n_empty -= cell->count == 1;
    *hs_entry_tail_at(&list->entries, to) = (hs_entry_tail){key.id, key.tag, number};
    write_entry(list, to, placed);
    if (is_new) {
        hash_put(&list->map, (hs_hash_row){to, key_mark(key)});
    } else {
        tell_moved(list, place, to);
        take_out(list, place);
    }
}

/* hs_dynamic_insert and hs_dynamic_move. */
static hs_status
put(hs_dynamic *list, hs_key key, const double *position, bool must_be_there, hs_failure *failure)
{
    static const int64_t nowhere[HS_MAX_DIM] = {0};
    hs_failure           ignored;
    hs_placed            placed;
    double               own[HS_MAX_DIM];
    uint32_t             number;
    failure = hs_failure_or(failure, &ignored);
    if (list == NULL || (position == NULL && list->storage != HS_STORE_ALL_PAIRS)) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, true);
    const uint32_t        place = hs_stored_find(list, key);
    const bool            is_new = place == HS_NO_PLACE;
    hs_status             status = must_be_there && is_new ? HS_ERR_KEY : HS_OK;
    if (status == HS_OK && position != NULL) {
        hs_read_position(list, position, own);
        status = hs_dynamic_place(list, own, &placed, failure);
    }
    if (status == HS_OK) {
        status = add_cell(list, position != NULL ? placed.index : nowhere, &number, failure);
    }
    if (status == HS_OK) {
        const bool comes = is_new || hs_entry_tail_at(&list->entries, place)->cell != number;
        if ((is_new && !reserve_rows(&list->map, list->map.n + 1)) ||
            (comes && !reserve_in_cell(list, number, 1))) {
            status = HS_ERR_MEMORY;
        } else {
            put_point(list, key, place, number, position != NULL ? &placed : NULL);
            list->changes++;
        }
    }
    hs_dynamic_leave(list, call);
    return status;
}

hs_status
hs_dynamic_insert(hs_dynamic *list, hs_key key, const double *position, hs_failure *failure)
{
    return put(list, key, position, false, failure);
}

hs_status
hs_dynamic_move(hs_dynamic *list, hs_key key, const double *position, hs_failure *failure)
{
    return put(list, key, position, true, failure);
}

/* False: the key was not there. */
static bool
remove_key(hs_dynamic *list, hs_key key)
{
    const uint32_t place = hs_stored_find(list, key);
    if (place == HS_NO_PLACE) {
        return false;
    }
    hs_hash_row *const rows = list->map.rows;
    const int64_t      last = list->map.n_rows - 1;
    int64_t            gap = row_of(&list->map, key_mark(key), place);
    for (int64_t r = (gap + 1) & last; rows[r].number != HS_NO_NUMBER; r = (r + 1) & last) {
        const int64_t home = rows[r].mark & (uint64_t)last;
        if (((r - home) & last) >= ((r - gap) & last)) { /* it may stand in the gap */
            rows[gap] = rows[r];
            gap = r;
        }
    }
    rows[gap].number = HS_NO_NUMBER;
    list->map.n--;
    list->n_without -= !has_position(list, place);
    take_out(list, place);
    list->changes++;
    return true;
}

bool
hs_dynamic_remove(hs_dynamic *list, hs_key key)
{
    if (list == NULL) {
        return false;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, true);
    const bool            was_there = remove_key(list, key);
    hs_dynamic_leave(list, call);
    return was_there;
}

/*
 * Many points at once. First each has the number of its cell, then each cell gets room for all that
 * comes into it, as if all were new, and at last each point is put where it belongs. Rows are
 * placed anew each time: to store what comes of it would cost more than to do it again.
 */

#define POINTS_A_CELL 4  /* or more: else a hash table grows meanwhile */
#define ROWS_AHEAD    32 /* whose memory is fetched before they are written */

/* Row i made ready. given: receives its numbers, which `placed` borrows. Statuses of
 * hs_dynamic_place, with failure->row. */
static hs_status
place_row(const hs_dynamic *list, double *const *x, int64_t i, double *given, hs_placed *placed,
          hs_failure *failure)
{
    for (int k = 0; k < list->lattice.ndim; k++) {
        given[k] = x[k][i];
    }
    const hs_status status = hs_dynamic_place(list, given, placed, failure);
    failure->row = status == HS_OK ? failure->row : i;
    return status;
}

/* Makes a range of cells hold one more, which may be the first. */
static void
widen(const hs_dynamic *list, const int64_t *index, bool is_first, int64_t *first, int64_t *last)
{
    for (int k = 0; k < list->lattice.ndim; k++) {
        first[k] = is_first || index[k] < first[k] ? index[k] : first[k];
        last[k] = is_first || index[k] > last[k] ? index[k] : last[k];
    }
}

/* The cell of each row, as long as the list is as it was. Dense cells are made to reach all rows
 * first, for which they are looked at where an axis is open. HS_ERR_INTERRUPTED, and statuses of
 * hs_dynamic_place and reserve_cells. */
static hs_status
number_rows(hs_dynamic *list, int64_t n, double *const *x, uint32_t *numbers, hs_failure *failure)
{
    int64_t   first[HS_MAX_DIM] = {0}, last[HS_MAX_DIM] = {0};
    double    given[HS_MAX_DIM];
    hs_placed placed;
    hs_status status = HS_OK;
    int       pass = list->cells.dense && list->lattice.n_periodic < list->lattice.ndim ? 0 : 1;
    for (; pass < 2 && status == HS_OK; pass++) {
        if (pass == 1) {
            status =
                reserve_cells(list, first, last, list->map.n == 0 ? n / POINTS_A_CELL : n, failure);
        }
        list->cells.keeps_empty = true;
        for (int64_t i = 0; i < n && status == HS_OK; i++) {
            if ((i + 1) % HS_POLL_POINTS == 0 && list->hooks.poll != NULL &&
                !list->hooks.poll(NULL, 0.0)) {
                return HS_ERR_INTERRUPTED;
            }
            status = place_row(list, x, i, given, &placed, failure);
            if (status == HS_OK && pass == 0) {
                widen(list, placed.index, i == 0, first, last);
            } else if (status == HS_OK) {
                status = add_cell(list, placed.index, &numbers[i], failure);
            }
        }
    }
    return status;
}

/* Room in each cell for all rows that go there, as if they were all new; in the order of the cells,
 * so that the blocks of neighbours lie side by side. */
static bool
reserve_blocks(hs_dynamic *list, const uint32_t *numbers, int64_t n)
{
    uint64_t *sorted = hs_alloc(NULL, HS_FOR_CELLS, 2 * n, sizeof *sorted);
    if (sorted == NULL) {
        return false;
    }
    bool fits = true;
    for (int64_t i = 0; i < n; i++) {
        sorted[i] = numbers[i];
    }
    hs_sort_numbers(sorted, n, 0, sorted + n);
    for (int64_t i = 0, begin = 0; fits && i < n; begin = i) {
        while (i < n && sorted[i] == sorted[begin]) {
            i++;
        }
        fits = reserve_in_cell(list, (uint32_t)sorted[begin], i - begin);
    }
    hs_free(NULL, sorted);
    return fits;
}

static hs_status
put_columns(hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t n, double *const *x,
            hs_failure *failure)
{
    if (n == 0) {
        return HS_OK;
    }
    if (list->map.n == 0) { /* what memory it has may not be where these points are */
        hs_stored_free(list);
    }
    uint32_t  *numbers = hs_alloc(NULL, HS_FOR_CELLS, n, sizeof *numbers);
    hs_status  status = numbers != NULL ? number_rows(list, n, x, numbers, failure) : HS_ERR_MEMORY;
    const bool numbered = status == HS_OK;
    if (numbered &&
        !(reserve_rows(&list->map, list->map.n + n) && reserve_blocks(list, numbers, n))) {
        status = HS_ERR_MEMORY;
    }
    const bool are_new = list->map.n == 0;
    double     given[HS_MAX_DIM];
    hs_placed  placed;
    for (int64_t i = 0; status == HS_OK && i < n; i++) {
        const hs_key   key = key_at(ids, tags, i);
        const uint32_t number = numbers[i];
        if (i + ROWS_AHEAD < n) { /* the points of a cell come from anywhere among the rows */
            const int64_t ahead = i + ROWS_AHEAD;
            const hs_cell cell = list->cells.cell[numbers[ahead]];
            HS_PREFETCH_WRITE(hs_entry_at(&list->entries, cell.start + cell.count));
            HS_PREFETCH_WRITE(&list->map.rows[key_mark(key_at(ids, tags, ahead)) &
                                              (uint64_t)(list->map.n_rows - 1)]);
        }
        const uint32_t place = are_new ? HS_NO_PLACE : hs_stored_find(list, key);
        (void)place_row(list, x, i, given, &placed, failure); /* it can be had: number_rows */
        if (place != HS_NO_PLACE) {
            numbers[i] = hs_entry_tail_at(&list->entries, place)->cell; /* that it was in */
        }
        put_point(list, key, place, number, &placed);
    }
    list->changes += status == HS_OK;
    list->cells.keeps_empty = false;
    for (int64_t i = 0; numbered && i < n; i++) { /* the blocks of cells that are empty */
        const uint32_t c = numbers[i];
        if (list->cells.cell[c].count == 0 && list->cells.size[c] != HS_NO_BLOCK) {
            give_block(&list->entries, list->cells.size[c], list->cells.cell[c].start);
            list->cells.size[c] = HS_NO_BLOCK;
        }
    }
    if (list->map.n == 0) {
        hs_stored_free(list);
    }
    hs_free(NULL, numbers);
    return status;
}

static hs_status
put_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags, const hs_points *positions,
         bool must_be_there, hs_failure *failure)
{
    const hs_options options = hs_options_default();
    hs_failure       ignored;
    hs_cloud         cloud;
    failure = hs_failure_or(failure, &ignored);
    if (list == NULL || positions == NULL || positions->ndim != list->lattice.ndim ||
        (ids == NULL && positions->n != 0)) {
        return HS_ERR_ARGUMENT;
    }
    hs_status status = hs_check_points(positions, failure);
    if (status != HS_OK) {
        return status;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, true);
    status = check_keys(list, ids, tags, positions->n, must_be_there, failure);
    if (status == HS_OK) {
        status = hs_cloud_load(NULL, NULL, positions, &options, &cloud, failure);
        if (status == HS_OK) {
            status = put_columns(list, ids, tags, positions->n, cloud.x, failure);
            hs_cloud_free(NULL, &cloud);
        }
    }
    hs_dynamic_leave(list, call);
    return status;
}

hs_status
hs_dynamic_insert_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags,
                       const hs_points *positions, hs_failure *failure)
{
    return put_many(list, ids, tags, positions, false, failure);
}

hs_status
hs_dynamic_move_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags,
                     const hs_points *positions, hs_failure *failure)
{
    return put_many(list, ids, tags, positions, true, failure);
}

hs_status
hs_dynamic_remove_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t n,
                       bool *removed, hs_failure *failure)
{
    hs_failure ignored;
    failure = hs_failure_or(failure, &ignored);
    if (list == NULL || n < 0 || (ids == NULL && n > 0)) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, true);
    const hs_status       status = check_keys(list, ids, tags, n, false, failure);
    for (int64_t i = 0; status == HS_OK && i < n; i++) {
        const bool was_there = remove_key(list, key_at(ids, tags, i));
        if (removed != NULL) {
            removed[i] = was_there;
        }
    }
    hs_dynamic_leave(list, call);
    return status;
}

/* Puts the points of a list into a copy of it without any, in no more memory than they need: first
 * the memory, and then the points, cell after cell. */
static hs_status
copy_points(const hs_dynamic *list, hs_dynamic *copy)
{
    int64_t    first[HS_MAX_DIM], last[HS_MAX_DIM], index[HS_MAX_DIM];
    int64_t    n_entries = 0, n_cells = 0;
    uint32_t   number;
    hs_failure ignored;
    for (int64_t c = 0; c < list->cells.n; c++) {
        if (list->cells.cell[c].count > 0) {
            index_of(&list->cells, (uint32_t)c, index);
            widen(list, index, n_cells == 0, first, last);
            n_entries += INT64_C(1) << block_size(list->cells.cell[c].count);
            n_cells++;
        }
    }
    if (n_cells > 0 &&
        !(reserve_rows(&copy->map, list->map.n) && reserve_entries(&copy->entries, n_entries) &&
          reserve_cells(copy, first, last, n_cells, &ignored) == HS_OK)) {
        return HS_ERR_MEMORY;
    }
    for (int64_t c = 0; c < list->cells.n; c++) {
        const hs_cell cell = list->cells.cell[c];
        if (cell.count == 0) {
            continue;
        }
        index_of(&list->cells, (uint32_t)c, index);
        (void)add_cell(copy, index, &number, &ignored); /* the memory is there */
        (void)reserve_in_cell(copy, number, cell.count);
        const uint32_t start = copy->cells.cell[number].start;
        copy_entries(&list->entries, cell.start, &copy->entries, start, cell.count);
        copy->cells.cell[number].count = cell.count;
        copy->cells.n_empty--;
        for (uint32_t e = 0; e < cell.count; e++) {
            hs_entry_tail *tail = hs_entry_tail_at(&copy->entries, start + e);
            tail->cell = number;
            hash_put(&copy->map, (hs_hash_row){start + e, key_mark((hs_key){tail->id, tail->tag})});
        }
    }
    copy->cells.is_wide = list->cells.is_wide;
    copy->n_without = list->n_without;
    copy->magnitude = list->magnitude;
    return HS_OK;
}

/* hs_dynamic_copy, of a list that is entered. */
static hs_status
make_copy(const hs_dynamic *list, hs_dynamic **copy)
{
    const int64_t bytes = list->offsets.at[list->offsets.reach + 1];
    *copy = NULL;
    hs_dynamic *made = hs_alloc(NULL, HS_FOR_CELLS, 1, sizeof *made);
    if (made == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(made, 0, sizeof *made);
    memcpy(made, list, offsetof(hs_dynamic, changes)); /* others may be at its gate */
    hs_gate_init(&made->gate);
    hs_stored_init(made, list->cells.dense, list->cells.most_bytes);
    made->offsets.slot = hs_alloc(NULL, HS_FOR_STENCIL, bytes, 1);
    if (made->offsets.slot == NULL || copy_points(list, made) != HS_OK) {
        hs_dynamic_free(made);
        return HS_ERR_MEMORY;
    }
    memcpy(made->offsets.slot, list->offsets.slot, (size_t)bytes);
    *copy = made;
    return HS_OK;
}

hs_status
hs_dynamic_copy(const hs_dynamic *list, hs_dynamic **copy)
{
    if (list == NULL || copy == NULL) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    const hs_status       status = make_copy(list, copy);
    hs_dynamic_leave(list, call);
    return status;
}

/* Keeps the points of a copy. On failure the list is as it was. */
hs_status
hs_dynamic_shrink_to_fit(hs_dynamic *list)
{
    hs_dynamic *copy;
    if (list == NULL) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, true);
    const hs_status       status = make_copy(list, &copy);
    if (status == HS_OK) {
        const hs_entries    entries = list->entries; /* others may be at its gate */
        const hs_hash       map = list->map;
        const hs_cell_table cells = list->cells;
        list->entries = copy->entries;
        list->map = copy->map;
        list->cells = copy->cells;
        list->changes++;
        copy->entries = entries;
        copy->map = map;
        copy->cells = cells;
        hs_dynamic_free(copy);
    }
    hs_dynamic_leave(list, call);
    return status;
}

hs_dynamic_state
hs_dynamic_look(const hs_dynamic *list)
{
    hs_dynamic_state state = {.ndim = 0};
    if (list == NULL) {
        return state;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    const int64_t indices = list->cells.dense ? 0 : list->lattice.ndim * (int64_t)sizeof(int32_t);
    state.ndim = list->lattice.ndim;
    state.n_points = list->map.n;
    state.n_without = list->n_without;
    state.n_cells = list->cells.n;
    state.n_empty = list->cells.dense ? 0 : list->cells.n_empty;
    state.bytes = (int64_t)sizeof *list + list->offsets.at[list->offsets.reach + 1] +
                  (int64_t)list->entries.capacity * (int64_t)list->entries.stride +
                  list->cells.capacity * ((int64_t)DENSE_CELL_BYTES + indices) +
                  (list->map.n_rows + list->cells.hash.n_rows) * (int64_t)sizeof(hs_hash_row);
    state.changes = list->changes;
    state.max_radius = list->max_radius;
    for (int k = 0; k < state.ndim; k++) {
        state.cell_size[k] = list->axis[k].width;
    }
    hs_dynamic_leave(list, call);
    return state;
}
