/* SPDX-License-Identifier: BSD-3-Clause */
#if !defined(_WIN32) && !defined(_POSIX_C_SOURCE)
#define _POSIX_C_SOURCE 200809L
#endif
#include "dynamic.h"
#include "../base/os_thread.h"
#include "../memory/memory.h"

#include <stdlib.h>

/* dynamic.c: points come into cells, move and go; the gate that readers and writers pass; lists as
 * a whole. */

/* A block that is too small is replaced by a larger one; the map learns where its entries are
 * now. */

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

bool
hs_cell_reserve(hs_dynamic *list, uint32_t number, int64_t count)
{
    hs_cell *const cell = &list->cells.cell[number];
    uint8_t *const size = &list->cells.size[number];
    const int      larger = block_size(count);
    if (*size != HS_NO_BLOCK && larger <= *size) {
        return true;
    }
    const uint32_t place = larger < HS_ENTRY_SIZES ? hs_entries_take(&list->entries, larger)
                                                   : HS_NO_PLACE;
    if (place == HS_NO_PLACE) {
        return false;
    }
    for (uint32_t e = 0; e < cell->count; e++) {
        const hs_entry_tail *tail = hs_entry_tail_at(&list->entries, cell->start + e);
        hs_entries_copy(&list->entries, cell->start + e, &list->entries, place + e, 1);
        hs_key_map_moved(&list->map, (hs_key){tail->id, tail->tag}, cell->start + e, place + e);
    }
    if (*size != HS_NO_BLOCK) {
        hs_entries_give(&list->entries, *size, cell->start);
    }
    cell->start = place;
    *size = (uint8_t)larger;
    return true;
}

/* The way in is one compare-and-swap; threads that do not get in sleep until one leaves. */

#define WRITER      (INT64_C(1) << 31)
#define PER_PROCESS (INT64_C(1) << 32)

/* The state where no thread of this process is inside. */
static int64_t
empty(void)
{
    return hs_atomic_load(&hs_n_forks) * PER_PROCESS;
}

/* Adds to what is inside, unless that is too much; threads of a parent are not. */
static bool
try_enter(hs_gate *gate, int64_t most, int64_t more)
{
    const int64_t state = hs_atomic_load(&gate->state), none = empty();
    const int64_t inside = state < none ? 0 : state - none;
    return inside <= most && hs_atomic_swap_if(&gate->state, state, none + inside + more);
}

static bool
try_read(void *gate)
{
    return try_enter(gate, WRITER - 2, 1);
}

static bool
try_write(void *gate)
{
    return try_enter(gate, 0, WRITER);
}

static bool
is_free(void *context)
{
    hs_gate *gate = context;
    return hs_atomic_load(&gate->state) <= empty();
}

static void
wake(void)
{
    if (hs_atomic_load(&hs_n_waiting) > 0) {
        hs_wake_waiting();
    }
}

void
hs_gate_init(hs_gate *gate)
{
    *gate = (hs_gate){.state = empty()};
}

bool
hs_gate_is_mine(hs_gate *gate)
{
    const int64_t holder = hs_atomic_load(&gate->holder);
    return holder != 0 && holder == HS_THREAD_NUMBER() &&
           gate->held_at == hs_atomic_load(&hs_n_forks);
}

bool
hs_gate_read(hs_gate *gate)
{
    if (hs_gate_is_mine(gate)) {
        return false;
    }
    if (!try_read(gate) && !try_read(gate)) {
        hs_wait_for(try_read, gate);
    }
    return true;
}

void
hs_gate_read_end(hs_gate *gate)
{
    if (hs_atomic_add(&gate->state, -1) % WRITER == 1) {
        wake();
    }
}

/* A writer that waits gives up what readers may need to get out, and takes it back before it goes
 * in: never the other way round. */
static HS_NO_INLINE void
wait_to_write(hs_gate *gate)
{
    if (gate->pause == NULL) {
        hs_wait_for(try_write, gate);
        return;
    }
    do {
        void *const paused = gate->pause();
        hs_wait_for(is_free, gate);
        gate->resume(paused);
    } while (!try_write(gate));
}

bool
hs_gate_write(hs_gate *gate)
{
    if (hs_gate_is_mine(gate)) {
        return false;
    }
    if (!try_write(gate) && !try_write(gate)) {
        wait_to_write(gate);
    }
    return true;
}

void
hs_gate_write_end(hs_gate *gate)
{
    hs_atomic_store(&gate->state, empty());
    wake();
}

bool
hs_gate_hold(hs_gate *gate)
{
    const bool went_in = hs_gate_write(gate);
    if (went_in) {
        gate->held_at = hs_atomic_load(&hs_n_forks);
        hs_atomic_store(&gate->holder, HS_THREAD_NUMBER());
    }
    return went_in;
}

void
hs_gate_release(hs_gate *gate)
{
    hs_atomic_store(&gate->holder, 0);
    hs_gate_write_end(gate);
}

/* Positions made ready, for the number of dimensions that a list has. */

hs_status
hs_dynamic_place(const hs_dynamic *list, const double *given, hs_placed *placed,
                 hs_failure *failure)
{
    switch (list->lattice.ndim) {
    case 2: return hs_dynamic_place_in(list, given, placed, failure, 2);
    case 3: return hs_dynamic_place_in(list, given, placed, failure, 3);
    default: return hs_dynamic_place_in(list, given, placed, failure, list->lattice.ndim);
    }
}

/* The largest sum of absolute terms that a coordinate is wrapped by, of those that the box moves:
 * others are what was given. */
static double
terms_of_wrapping(const hs_dynamic *list, const hs_placed *placed)
{
    const hs_lattice *lattice = &list->lattice;
    int64_t           given_turns[HS_MAX_DIM];
    double            largest = 0.0;
    (void)hs_lattice_shift(lattice, placed->turns, given_turns); /* as when it was wrapped */
    for (int c = 0; c < lattice->ndim; c++) {
        double terms = list->moves[c] ? fabs(placed->given[c]) : 0.0;
        for (int l = 0; l < lattice->n_periodic; l++) {
            terms += fabs((double)given_turns[l] * lattice->given[l][c]);
        }
        largest = hs_larger(terms, largest);
    }
    return largest;
}

bool
hs_dynamic_is_known(const hs_dynamic *list, hs_placed *placed)
{
    const hs_lattice *lattice = &list->lattice;
    bool              known = true;
    if (placed->magnitude > 0x1p-50 * list->most_terms) {
        placed->magnitude = terms_of_wrapping(list, placed);
        known = placed->magnitude <= list->most_terms;
    }
    for (int k = 0; k < lattice->ndim; k++) {
        placed->terms[k] = hs_axis_terms(lattice, placed->x, k);
        known = known && placed->terms[k] < list->axes.axis[k].farthest;
    }
    return known;
}

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
dynamic_write(hs_dynamic *list, uint32_t place, const hs_placed *placed)
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

/* All memory first, then cell after cell, in order. */

/* Makes a range of cells hold one more, which may be the first. */
static void
widen(const hs_dynamic *list, const int64_t *index, bool is_first, int64_t *first, int64_t *last)
{
    for (int k = 0; k < list->lattice.ndim; k++) {
        first[k] = is_first || index[k] < first[k] ? index[k] : first[k];
        last[k] = is_first || index[k] > last[k] ? index[k] : last[k];
    }
}

/* Memory for all that a copy will hold, and no more. */
static bool
reserve_copy(const hs_dynamic *list, hs_dynamic *copy)
{
    int64_t    first[HS_MAX_DIM], last[HS_MAX_DIM], index[HS_MAX_DIM];
    int64_t    n_entries = 0, n_cells = 0;
    hs_failure ignored;
    for (int64_t c = 0; c < list->cells.n; c++) {
        if (list->cells.cell[c].count > 0) {
            hs_cell_table_index(&list->cells, (uint32_t)c, index);
            widen(list, index, n_cells == 0, first, last);
            n_entries += INT64_C(1) << block_size(list->cells.cell[c].count);
            n_cells++;
        }
    }
    return n_cells == 0 || (hs_hash_reserve(&copy->map.hash, list->map.n) &&
                            hs_entries_reserve(&copy->entries, n_entries) &&
                            hs_cell_table_reserve(&copy->cells, &copy->entries, first, last,
                                                  n_cells, &ignored) == HS_OK);
}

/* copy: of the same kind, without points. HS_ERR_MEMORY: that it stays. */
static hs_status
copy_points(const hs_dynamic *list, hs_dynamic *copy)
{
    int64_t    index[HS_MAX_DIM];
    uint32_t   number;
    hs_failure ignored;
    if (!reserve_copy(list, copy)) {
        return HS_ERR_MEMORY;
    }
    for (int64_t c = 0; c < list->cells.n; c++) {
        const hs_cell cell = list->cells.cell[c];
        if (cell.count == 0) {
            continue;
        }
        hs_cell_table_index(&list->cells, (uint32_t)c, index);
        /* reserve_copy has the memory */
        (void)hs_cell_table_add(&copy->cells, &copy->entries, index, &number, &ignored);
        (void)hs_cell_reserve(copy, number, cell.count);
        const uint32_t start = copy->cells.cell[number].start;
        hs_entries_copy(&list->entries, cell.start, &copy->entries, start, cell.count);
        copy->cells.cell[number].count = cell.count;
        copy->cells.n_empty--;
        for (uint32_t e = 0; e < cell.count; e++) {
            hs_entry_tail *tail = hs_entry_tail_at(&copy->entries, start + e);
            tail->cell = number;
            hs_key_map_add(&copy->map, (hs_key){tail->id, tail->tag}, start + e);
        }
    }
    copy->cells.is_wide = list->cells.is_wide;
    return HS_OK;
}

/* The checks of options, and lists that are made, copied and emptied. A copy is a new list into
 * which the points of the old one are put, cell after cell; shrinking makes one and keeps it. */

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
check_options(const hs_dynamic_options *options, hs_failure *failure)
{
    const double  radius = options->max_radius;
    const hs_box *box = options->box;
    const int     d = options->ndim;
    if (d < 1 || d > HS_MAX_DIM || (int)options->storage < 0 ||
        options->storage > HS_STORE_ALL_PAIRS || !(options->grid_bytes >= 0.0) ||
        (box != NULL && box->ndim != d)) {
        return HS_ERR_ARGUMENT;
    }
    if (!is_length(options->cell_size)) {
        return refuse_length(failure, HS_LENGTH_CELL_SIZE, options->cell_size);
    }
    if (radius != 0.0 && !is_length(radius)) {
        return refuse_length(failure, HS_LENGTH_MAX_RADIUS, radius);
    }
    const hs_status status = box != NULL ? hs_box_check(box, failure) : HS_OK;
    for (int l = 0; box != NULL && status == HS_OK && l < d; l++) {
        for (int k = 0; box->periodic[l] && k < d; k++) {
            if (box->rows[l][k] != 0.0 && !is_length(fabs(box->rows[l][k]))) {
                return refuse_length(failure, HS_LENGTH_BOX, box->rows[l][k]);
            }
        }
    }
    return status;
}

/* Sums over the box that bounds of rounding are made of. Returns how many images of a ball a query
 * may have to look at, as far as its centre does not add to them. */
static double
measure_box(hs_dynamic *list)
{
    double least = INFINITY, n_images = 1.0;
    for (int r = 0; r < list->lattice.n_periodic; r++) {
        list->row_error += list->lattice.row_error[r];
        for (int k = 0; k < list->lattice.ndim; k++) {
            list->spread += fabs(list->lattice.rows[r][k]);
        }
    }
    for (int k = 0; k < list->lattice.ndim; k++) {
        const hs_axis *axis = &list->axes.axis[k];
        for (int l = 0; l < list->lattice.n_periodic; l++) {
            list->moves[k] = list->moves[k] || list->lattice.given[l][k] != 0.0;
        }
        if (axis->row >= 0) {
            least = hs_smaller(axis->period, least);
            n_images *= 2.0 * ceil((list->max_radius + axis->leak) / axis->period) + 1.0;
        }
    }
    list->most_terms = 0x1p90 * least;
    return n_images;
}

hs_status
hs_list_new(const hs_dynamic_options *options, hs_dynamic **list, hs_failure *failure)
{
    hs_status   status = check_options(options, failure);
    hs_dynamic *made = status == HS_OK ? hs_alloc(NULL, HS_FOR_CELLS, 1, sizeof *made) : NULL;
    if (made == NULL) {
        return status == HS_OK ? HS_ERR_MEMORY : status;
    }
    memset(made, 0, sizeof *made);
    made->storage = options->storage;
    made->inclusive = options->inclusive;
    made->max_radius = options->max_radius != 0.0 ? options->max_radius : options->cell_size;
    hs_gate_init(&made->gate);
    hs_lattice_init(options->box, options->ndim, hs_scale_of(0), &made->lattice);
    if (hs_skew_is_left(&made->lattice)) {
        status = HS_ERR_BOX_SKEWED;
    } else {
        hs_axes_init(&made->axes, &made->lattice, options->cell_size,
                     options->storage == HS_STORE_ALL_PAIRS, made->max_radius);
        hs_entries_init(&made->entries, options->ndim, made->lattice.n_periodic > 0);
        hs_cell_table_init(&made->cells, &made->axes, options->storage != HS_STORE_HASH,
                           options->grid_bytes);
        if (!(measure_box(made) <= MOST_IMAGES)) {
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

/* No points, and no memory of them. */
static void
start_points(hs_dynamic *list)
{
    hs_entries_init(&list->entries, list->lattice.ndim, list->entries.keeps_given);
    hs_cell_table_init(&list->cells, &list->axes, list->cells.dense, list->cells.most_bytes);
    list->map = (hs_key_map){.n = 0};
}

hs_status
hs_list_copy(const hs_dynamic *list, hs_dynamic **copy)
{
    *copy = NULL;
    hs_dynamic *made = hs_alloc(NULL, HS_FOR_CELLS, 1, sizeof *made);
    if (made == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(made, 0, sizeof *made);
    memcpy(made, list, offsetof(hs_dynamic, changes)); /* others may be at its gate */
    hs_gate_init(&made->gate);
    start_points(made);
    if (!hs_offsets_copy(&list->offsets, &made->offsets) || copy_points(list, made) != HS_OK) {
        hs_list_free(made);
        return HS_ERR_MEMORY;
    }
    *copy = made;
    return HS_OK;
}

void
hs_list_clear(hs_dynamic *list)
{
    free_points(list);
    start_points(list);
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
    free_points(list);
    list->entries = copy->entries;
    list->map = copy->map;
    list->cells = copy->cells;
    list->changes++;
    start_points(copy);
    hs_list_free(copy);
    return HS_OK;
}

/*
 * A point comes into a cell, goes out of it or moves on, once there is room: nothing here can fail.
 * A point that stays in its cell is written over; else it is appended to its new cell and taken out
 * of the old one.
 */

/* A new entry behind those of a cell that has room for it; returns its place. */
HS_ALWAYS_INLINE uint32_t
append_entry(hs_dynamic *list, uint32_t number, hs_key key, const hs_placed *placed)
{
    hs_cell *const       cell = &list->cells.cell[number];
    const uint32_t       place = cell->start + cell->count;
    hs_entry_tail *const tail = hs_entry_tail_at(&list->entries, place);
    list->cells.n_empty -= cell->count == 0;
    cell->count++;
    tail->id = key.id;
    tail->tag = key.tag;
    tail->cell = number;
    dynamic_write(list, place, placed);
    return place;
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
        const hs_entry_tail *tail = hs_entry_tail_at(&list->entries, last);
        hs_key_map_moved(&list->map, (hs_key){tail->id, tail->tag}, last, place);
        hs_entries_copy(&list->entries, last, &list->entries, place, 1);
    }
    cell->count--;
    list->cells.n_empty += cell->count == 0;
    if (cell->count == 0 && !list->cells.keeps_empty) {
        hs_entries_give(&list->entries, list->cells.size[number], cell->start);
        list->cells.size[number] = HS_NO_BLOCK;
    }
}

HS_ALWAYS_INLINE bool
has_position(const hs_dynamic *list, uint32_t place)
{
    return !isnan(hs_entry_at(&list->entries, place)[0]);
}

/* The point of a key that is there, for which its new cell has room if that is another one. */
HS_ALWAYS_INLINE void
put_again(hs_dynamic *list, hs_key key, uint32_t place, uint32_t number, const hs_placed *placed)
{
    list->n_without += (placed == NULL) - !has_position(list, place);
    if (hs_entry_tail_at(&list->entries, place)->cell == number) {
        dynamic_write(list, place, placed);
        return;
    }
    const uint32_t to = append_entry(list, number, key, placed);
    hs_key_map_moved(&list->map, key, place, to);
    take_out(list, place);
}

HS_ALWAYS_INLINE void
put_new(hs_dynamic *list, hs_key key, uint32_t number, const hs_placed *placed)
{
    list->n_without += placed == NULL;
    hs_key_map_add(&list->map, key, append_entry(list, number, key, placed));
}

/* One point. Memory first, then changes that cannot fail. */

hs_status
hs_update_insert(hs_dynamic *list, hs_key key, const hs_placed *placed, hs_failure *failure)
{
    static const int64_t nowhere[HS_MAX_DIM] = {0};
    uint32_t             number;
    const int64_t       *index = placed != NULL ? placed->index : nowhere;
    const hs_status      status =
        hs_cell_table_add(&list->cells, &list->entries, index, &number, failure);
    if (status != HS_OK) {
        return status;
    }
    uint32_t place = hs_key_map_find(&list->map, &list->entries, key);
    if (place == HS_NO_PLACE && !hs_hash_reserve(&list->map.hash, list->map.n + 1)) {
        return HS_ERR_MEMORY;
    }
    if (place == HS_NO_PLACE || hs_entry_tail_at(&list->entries, place)->cell != number) {
        if (!hs_cell_reserve(list, number, (int64_t)list->cells.cell[number].count + 1)) {
            return HS_ERR_MEMORY;
        }
    }
    if (place == HS_NO_PLACE) {
        put_new(list, key, number, placed);
    } else {
        put_again(list, key, place, number, placed);
    }
    list->changes++;
    return HS_OK;
}

bool
hs_update_remove(hs_dynamic *list, hs_key key)
{
    const uint32_t place = hs_key_map_find(&list->map, &list->entries, key);
    if (place == HS_NO_PLACE) {
        return false;
    }
    list->n_without -= !has_position(list, place);
    hs_key_map_remove(&list->map, key, place);
    take_out(list, place);
    list->changes++;
    return true;
}

/*
 * Many points at once. First each has the number of its cell, then each cell gets room for all that
 * comes into it, as if all were new, and at last each point is put where it belongs. Rows are
 * placed anew each time: to store what comes of it would cost more than to do it again.
 */

#define POINTS_A_CELL 4  /* or more: else a hash table grows meanwhile */
#define FEW_ROWS      16 /* where there are more cells for each row, not all are looked at */
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

/* The cell of each row, as long as the list is as it was. Dense cells are made to reach all rows
 * first, for which they are looked at where an axis is open. HS_ERR_INTERRUPTED, and statuses of
 * hs_dynamic_place and hs_cell_table_reserve. */
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
            status = hs_cell_table_reserve(&list->cells, &list->entries, first, last,
                                           list->map.n == 0 ? n / POINTS_A_CELL : n, failure);
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
                status = hs_cell_table_add(&list->cells, &list->entries, placed.index, &numbers[i],
                                           failure);
            }
        }
    }
    return status;
}

static int
compare_cells(const void *one, const void *other)
{
    const uint32_t a = *(const uint32_t *)one, b = *(const uint32_t *)other;
    return (a > b) - (a < b);
}

static bool
reserve_more(hs_dynamic *list, uint32_t number, int64_t more)
{
    return hs_cell_reserve(list, number, (int64_t)list->cells.cell[number].count + more);
}

/* Room in each cell for all rows that go there, as if they were all new; in the order of the cells,
 * so that the blocks of neighbours lie side by side. */
static bool
reserve_cells(hs_dynamic *list, const uint32_t *numbers, int64_t n)
{
    const bool    few = n < list->cells.n / FEW_ROWS; /* sorted, else counted */
    const int64_t n_scratch = few ? n : list->cells.n;
    uint32_t     *scratch = hs_alloc(NULL, HS_FOR_CELLS, n_scratch, sizeof *scratch);
    bool          fits = scratch != NULL;
    if (fits && few) {
        memcpy(scratch, numbers, (size_t)n * sizeof *scratch);
        qsort(scratch, (size_t)n, sizeof *scratch, compare_cells);
        for (int64_t i = 0, begin = 0; fits && i < n; begin = i) {
            while (i < n && scratch[i] == scratch[begin]) {
                i++;
            }
            fits = reserve_more(list, scratch[begin], i - begin);
        }
    } else if (fits) {
        memset(scratch, 0, (size_t)n_scratch * sizeof *scratch);
        for (int64_t i = 0; i < n; i++) {
            scratch[numbers[i]]++;
        }
        for (int64_t c = 0; fits && c < n_scratch; c++) {
            fits = scratch[c] == 0 || reserve_more(list, (uint32_t)c, scratch[c]);
        }
    }
    hs_free(NULL, scratch);
    return fits;
}

/* Puts the rows into their cells, which have room; numbers: receives the cells that they were in,
 * or are in if they are new. */
static void
put_rows(hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t n, double *const *x,
         uint32_t *numbers, hs_failure *failure)
{
    const bool are_new = list->map.n == 0;
    double     given[HS_MAX_DIM];
    hs_placed  placed;
    for (int64_t i = 0; i < n; i++) {
        const hs_key   key = {ids[i], tags != NULL ? tags[i] : 0};
        const uint32_t number = numbers[i];
        if (i + ROWS_AHEAD < n) { /* the points of a cell come from anywhere among the rows */
            const int64_t ahead = i + ROWS_AHEAD;
            const hs_cell cell = list->cells.cell[numbers[ahead]];
            HS_PREFETCH_WRITE(hs_entry_at(&list->entries, cell.start + cell.count));
            HS_PREFETCH_WRITE(hs_entry_given(&list->entries, cell.start + cell.count));
            hs_key_map_expect(&list->map, (hs_key){ids[ahead], tags != NULL ? tags[ahead] : 0});
        }
        const uint32_t place = are_new ? HS_NO_PLACE
                                       : hs_key_map_find(&list->map, &list->entries, key);
        (void)place_row(list, x, i, given, &placed, failure); /* it can be had: number_rows */
        if (place == HS_NO_PLACE) {
            put_new(list, key, number, &placed);
        } else {
            numbers[i] = hs_entry_tail_at(&list->entries, place)->cell;
            put_again(list, key, place, number, &placed);
        }
    }
}

hs_status
hs_update_insert_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t n,
                      double *const *x, hs_failure *failure)
{
    if (n == 0) {
        return HS_OK;
    }
    if (list->map.n == 0) { /* what memory it has may not be where these points are */
        hs_list_clear(list);
    }
    uint32_t  *numbers = hs_alloc(NULL, HS_FOR_CELLS, n, sizeof *numbers);
    hs_status  status = numbers != NULL ? number_rows(list, n, x, numbers, failure) : HS_ERR_MEMORY;
    const bool numbered = status == HS_OK;
    if (numbered &&
        !(hs_hash_reserve(&list->map.hash, list->map.n + n) && reserve_cells(list, numbers, n))) {
        status = HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        put_rows(list, ids, tags, n, x, numbers, failure);
        list->changes++;
    }
    list->cells.keeps_empty = false;
    for (int64_t i = 0; numbered && i < n; i++) { /* the blocks of cells that are empty */
        const uint32_t c = numbers[i];
        if (list->cells.cell[c].count == 0 && list->cells.size[c] != HS_NO_BLOCK) {
            hs_entries_give(&list->entries, list->cells.size[c], list->cells.cell[c].start);
            list->cells.size[c] = HS_NO_BLOCK;
        }
    }
    if (list->map.n == 0) {
        hs_list_clear(list);
    }
    hs_free(NULL, numbers);
    return status;
}
