/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_DYNAMIC_DYNAMIC_H
#define HS_DYNAMIC_DYNAMIC_H

#include "../../halfshell_dynamic.h"
#include "../base/base.h"
#include "../base/os.h"
#include "../base/status.h"
#include "../box/lattice.h"
#include "../box/wrap.h"

#include <math.h>
#include <stdint.h>

/*
 * dynamic.h: a list of points that come, go and move, each under a key.
 *
 * Each point is an entry: its wrapped position, key, cell and position as given, side by side, so
 * that a query reads nothing but the entries of cells. The entries of a cell lie in one block of a
 * power of two; a block that is full is replaced by one of twice the size. A map leads from keys to
 * entries. Removal moves the last entry of the cell into the gap and tells the map: it takes the
 * same time however crowded the cell is.
 */

/*
 * Where entries lie: in blocks of 1, 2, 4, ... of them, cut from one array that grows. A
 * block that is given back serves the next one of its size. An entry is known by its place, its
 * number in the array, which stays while the array grows.
 */

#define HS_NO_PLACE    UINT32_MAX
#define HS_ENTRY_SIZES 32 /* blocks of 2^0 ... 2^31 entries */

/* What follows the coordinates of an entry. The position as given comes behind it, where positions
 * are wrapped. */
typedef struct hs_entry_tail {
    int64_t  id;
    int32_t  tag;
    uint32_t cell;
} hs_entry_tail;

typedef struct hs_entries {
    int            ndim;
    size_t         stride;           /* bytes of an entry: coordinates, tail, position as given */
    bool           keeps_given;      /* else the coordinates are the position as given */
    unsigned char *data;             /* owned */
    uint32_t       n_used, capacity; /* entries in blocks, past or present; that fit */
    uint32_t       spare[HS_ENTRY_SIZES]; /* first free block of each size, or HS_NO_PLACE */
} hs_entries;

HS_ALWAYS_INLINE double *
hs_entry_at(const hs_entries *entries, uint32_t place)
{
    return (double *)(void *)(entries->data + (size_t)place * entries->stride);
}

HS_ALWAYS_INLINE hs_entry_tail *
hs_entry_tail_at(const hs_entries *entries, uint32_t place)
{
    return (hs_entry_tail *)(void *)(hs_entry_at(entries, place) + entries->ndim);
}

/* The position as it was given. */
HS_ALWAYS_INLINE double *
hs_entry_given(const hs_entries *entries, uint32_t place)
{
    return entries->keeps_given ? (double *)(void *)(hs_entry_tail_at(entries, place) + 1)
                                : hs_entry_at(entries, place);
}

/*
 * From what has a hash to a number. Open addressing with linear probing: a row holds the number and
 * 32 bits of the hash, its mark, which say where the row belongs; what was hashed is looked up by
 * the number. Removal closes the gap, so that no row is ever wasted on what is gone.
 */

#define HS_NO_NUMBER UINT32_MAX

typedef struct hs_hash_row {
    uint32_t number; /* HS_NO_NUMBER: the row is free */
    uint32_t mark;
} hs_hash_row;

typedef struct hs_hash {
    hs_hash_row *rows;   /* owned */
    int64_t      n_rows; /* 0, or a power of two; at most three quarters are in use */
    int64_t      n;      /* numbers */
} hs_hash;

/* The next number under this mark, from row *r on, which is the mark at first; HS_NO_NUMBER: there
 * is none any more. */
HS_ALWAYS_INLINE uint32_t
hs_hash_next(const hs_hash *hash, uint32_t mark, int64_t *r)
{
    const int64_t last = hash->n_rows - 1;
    hs_hash_row   row = {HS_NO_NUMBER, mark};
    do {
        row = last >= 0 ? hash->rows[(*r)++ & last] : row;
    } while (row.number != HS_NO_NUMBER && row.mark != mark);
    return row.number;
}

/*
 * Which cell a coordinate is in, along each grid axis, and which cells a ball meets.
 *
 * The index of a cell is a monotone function of the coordinate as it is stored. A ball from t - R
 * to t + R, rounded outwards, therefore meets no cells but those from the index of its lower end to
 * that of its upper end, however these were rounded: at any radius, also a multiple of the width.
 *
 * Along a periodic axis with n cells indices go on: u = cell + n * image. Image m of a cell is
 * where m periods have been added to its points.
 */

#define HS_FARTHEST_CELL 0x1p52 /* from here on float64 does not tell neighbouring cells apart */

typedef struct hs_axis {
    int     row;             /* of B, or -1: open */
    int64_t n;               /* cells in a period; 0: open */
    double  inverse;         /* cells a unit of length; 0: one cell */
    double  width;           /* 1 / inverse; infinity: one cell */
    double  half;            /* half a period; 0: open */
    double  lowest, highest; /* cells of a period, or as far as there are any */
    double  period;          /* 0: open */
    double  leak;     /* by how much images that a query can meet may move along this axis otherwise
                      * than by whole periods, and what wrapped points are rounded by however near
                      * they are; 0 in aligned boxes */
    double  farthest; /* sum of absolute terms of coordinates that are too far away; as above */
} hs_axis;

/*
 * Coordinates of X along the axes of general boxes are rounded sums of products with X, which is
 * rounded itself: by less than this of the sum of absolute products.
 */
HS_ALWAYS_INLINE double
hs_axis_rounding(int ndim)
{
    return (ndim + 4) * 0x1p-53;
}

/* Sum of absolute products that t_k of X is made of. */
HS_ALWAYS_INLINE double
hs_axis_terms(const hs_lattice *lattice, const double *x, int k)
{
    double terms = 0.0;
    for (int c = 0; c < lattice->ndim; c++) {
        terms += fabs(lattice->normal[k][c] * x[c]);
    }
    return terms;
}

/* The cell of a coordinate: any integer up to HS_FARTHEST_CELL, or from 0 to n - 1. Rounded down by
 * way of an integer, once it is bounded, also where infinity times 0 is no number: floor() is a
 * call where the CPU may lack an instruction for it. */
HS_ALWAYS_INLINE int64_t
hs_axis_cell(const hs_axis *axis, double t)
{
    const double  place = hs_smaller((t + axis->half) * axis->inverse, axis->highest);
    const double  bounded = hs_larger(place, axis->lowest);
    const int64_t whole = (int64_t)bounded;
    return axis->n > 0 ? whole : whole - ((double)whole > bounded);
}

/*
 * From the indices of a cell to its entries. Either every cell between the outermost has a number
 * by its place in the grid (dense), or those that have been occupied are numbered as they come, and
 * a hash table knows them (sparse). A sparse table that is full drops its empty cells before it
 * grows, if half of them are empty, or if memory is refused.
 */

#define HS_NO_CELL  HS_NO_NUMBER
#define HS_NO_BLOCK UINT8_MAX

typedef struct hs_cell {
    uint32_t start, count; /* places start to start + count - 1 */
} hs_cell;

typedef struct hs_cell_table {
    bool     dense;
    bool     keeps_empty; /* empty cells keep their numbers and blocks: others are about to come */
    int      ndim;
    int64_t  n;        /* cells */
    int64_t  capacity; /* of the next three */
    hs_cell *cell;     /* owned */
    uint8_t *size;     /* owned: a block has 2^size entries; HS_NO_BLOCK: there is none */
    int32_t *index;    /* owned, sparse: ndim a cell, the indices modulo 2^32 */
    /* sparse */
    hs_hash hash;    /* numbers are those of cells */
    int64_t n_empty; /* cells without entries */
    bool    is_wide; /* some index was beyond int32, so that cells may be shared */
    /* dense */
    double  most_bytes;
    int64_t lowest[HS_MAX_DIM], shape[HS_MAX_DIM], stride[HS_MAX_DIM];
} hs_cell_table;

/* What index x of axis k adds to the hash of a cell, and the row mark of such a sum. */
HS_ALWAYS_INLINE uint64_t
hs_cell_part(int k, int64_t x)
{
    static const uint64_t factor[HS_MAX_DIM] = {
        UINT64_C(0x9E3779B97F4A7C15), UINT64_C(0xC2B2AE3D27D4EB4F), UINT64_C(0x165667B19E3779F9),
        UINT64_C(0xD6E8FEB86659FD93), UINT64_C(0xBF58476D1CE4E5B9), UINT64_C(0x94D049BB133111EB),
        UINT64_C(0xFF51AFD7ED558CCD), UINT64_C(0xC4CEB9FE1A85EC53)};
    return (uint64_t)(uint32_t)x * factor[k];
}

HS_ALWAYS_INLINE uint32_t
hs_cell_mark(uint64_t sum)
{
    return (uint32_t)(((sum ^ (sum >> 29)) * UINT64_C(0xBF58476D1CE4E5B9)) >> 32);
}

/* The cell with these indices and the mark that they have, or HS_NO_CELL. */
HS_ALWAYS_INLINE uint32_t
hs_cell_table_probe(const hs_cell_table *table, const int64_t *index, uint32_t mark)
{
    int64_t r = mark;
    for (;;) {
        const uint32_t number = hs_hash_next(&table->hash, mark, &r);
        if (number == HS_NO_CELL) {
            return number;
        }
        const int32_t *found = table->index + (int64_t)number * table->ndim;
        int            k = 0;
        while (k < table->ndim && found[k] == (int32_t)(uint32_t)index[k]) {
            k++;
        }
        if (k == table->ndim) {
            return number;
        }
    }
}

/*
 * The cells around a query's cell, nearest first: ordered by the least distance between
 * points of the two cells, then by the distance of their centres, then by index. One list for each
 * number of cells that a ball reaches to a side; a ball that reaches farther is walked in the order
 * of indices.
 */

#define HS_MOST_REACH   15   /* cells to a side */
#define HS_MOST_OFFSETS 8192 /* of one list */
#define HS_SLOTS        (2 * HS_MOST_REACH + 1)

typedef struct hs_offsets {
    int      reach;                 /* lists 0 to `reach` are there */
    int64_t  n[HS_MOST_REACH + 1];  /* offsets of each */
    int64_t  at[HS_MOST_REACH + 2]; /* bytes before each, and of all */
    uint8_t *slot;                  /* owned: ndim each, the offset plus HS_MOST_REACH */
} hs_offsets;

/*
 * A lock that many readers may hold at once, or one writer. Free, it costs two atomic
 * instructions a call, which is what a list of a hundred nanoseconds a call can afford; only a
 * thread that has to wait calls the system.
 */

/* How many readers are inside, or that a writer is, and after how many forks (os_thread.h). */
typedef struct hs_gate {
    volatile int64_t state;
    volatile int64_t holder;  /* number of the thread that is the writer for many calls; 0: none */
    int64_t          held_at; /* how many forks there had been when it became that */
    void *(*pause)(void);     /* around each wait of a writer; NULL: nothing is done */
    void (*resume)(void *paused);
} hs_gate;

void hs_gate_init(hs_gate *gate);

/* Goes in, a writer alone, once that can be. False: this thread holds the gate, and is inside. */
bool hs_gate_enter(hs_gate *gate, bool writes);
void hs_gate_leave(hs_gate *gate, bool writes);

/* A writer for many calls. False: this thread holds the gate already. */
bool hs_gate_hold(hs_gate *gate);
bool hs_gate_is_mine(hs_gate *gate); /* whether this thread holds it */
void hs_gate_release(hs_gate *gate); /* which this thread holds */

struct hs_dynamic {
    hs_storage storage;
    bool       inclusive;
    hs_fpenv   held_env; /* hs_dynamic_hold */
    double     max_radius;
    hs_lattice lattice;
    double     spread;            /* sum of all |entries| of B */
    double     row_error;         /* sum of the errors of B */
    bool       moves[HS_MAX_DIM]; /* whether B does, along each coordinate axis */
    double     most_terms;        /* of wrapping: beyond, X errs by a period or so */
    double     magnitude; /* of wrapping, of all points that were ever here: at most most_terms */
    hs_axis    axis[HS_MAX_DIM];
    hs_offsets offsets;
    hs_entries entries;
    hs_hash    map; /* from keys to places of entries */
    hs_cell_table        cells;
    int64_t              n_without; /* entries without a position, whose coordinates are NaN */
    int64_t              changes;   /* from here on nothing is copied to another list */
    hs_gate              gate;
    hs_dynamic_hooks     hooks;
    hs_dynamic_counters *counters; /* borrowed, or NULL */
};

/* A position as a list stores it: brought into the middle period, and its cell. */
typedef struct hs_placed {
    const double *given;             /* borrowed; ndim finite numbers */
    double        x[HS_MAX_DIM];     /* X, in the middle period; not rounded in aligned boxes */
    double        t[HS_MAX_DIM];     /* coordinates along the grid axes */
    double        terms[HS_MAX_DIM]; /* sums of absolute products in them; not in aligned boxes */
    int64_t       turns[HS_MAX_DIM]; /* over the rows of B */
    int64_t       index[HS_MAX_DIM]; /* of the cell */
    double        magnitude; /* as hs_wrap_point raises it, of the coordinates that the box moves;
                              * not in aligned boxes */
} hs_placed;

/*
 * X and turns of finite numbers; false beyond HS_WRAP_LIMIT. *magnitude as in hs_wrap_point.
 * Aligned boxes wrap each coordinate exactly, others by compensated sums. Most points are inside
 * or one period away, where the difference is exact, as wrap.c says of its columns.
 */
HS_ALWAYS_INLINE bool
hs_dynamic_wrap(const hs_dynamic *list, const double *given, double *wrapped, int64_t *turns,
                double *magnitude, const int ndim)
{
    bool fits = true;
    if (!list->lattice.aligned) {
        return hs_wrap_point(&list->lattice, given, wrapped, turns, magnitude);
    }
    for (int k = 0; k < ndim; k++) {
        const hs_axis *axis = &list->axis[k];
        const double   x = given[k], size = fabs(x);
        wrapped[k] = x;
        if (axis->row < 0) {
            continue;
        }
        if (size <= 1.25 * axis->period) {
            /* No branch: which half of the box a point is in cannot be predicted. */
            const double turn = (double)((x > axis->half) - (x < -axis->half));
            wrapped[k] = x - turn * axis->period;
            turns[axis->row] = (int64_t)turn;
        } else {
            wrapped[k] = hs_wrap_axis(x, axis->period, &turns[axis->row]);
            fits = fits && turns[axis->row] != HS_WRAP_UNKNOWN;
        }
    }
    return fits;
}

/* HS_OK, HS_ERR_NOT_FINITE with column and value, HS_ERR_SHIFT_RANGE. */
hs_status hs_dynamic_place(const hs_dynamic *list, const double *given, hs_placed *placed,
                           hs_failure *failure);

/* What each public function of a list does first and last. */
typedef struct hs_dynamic_call {
    hs_fpenv env;
    bool     writes;
    bool     went_in; /* false: this thread holds the list */
} hs_dynamic_call;

/* Waits until the list may be used, and sets the rounding mode. */
HS_ALWAYS_INLINE hs_dynamic_call
hs_dynamic_enter(const hs_dynamic *list, bool writes)
{
    hs_gate        *gate = &((hs_dynamic *)list)->gate; /* it changes, the list does not */
    hs_dynamic_call call = {.writes = writes};
    call.went_in = hs_gate_enter(gate, writes);
    if (call.went_in) {
        call.env = hs_fpenv_enter();
    }
    return call;
}

HS_ALWAYS_INLINE void
hs_dynamic_leave(const hs_dynamic *list, hs_dynamic_call call)
{
    hs_gate *gate = &((hs_dynamic *)list)->gate;
    if (call.went_in) {
        hs_fpenv_leave(call.env);
        hs_gate_leave(gate, call.writes);
    }
}

/* Where a failure goes. */
HS_ALWAYS_INLINE hs_failure *
hs_failure_or(hs_failure *failure, hs_failure *ignored)
{
    failure = failure != NULL ? failure : ignored;
    *failure = HS_NO_FAILURE;
    return failure;
}

/* The caller's numbers, each read once. */
HS_ALWAYS_INLINE void
hs_read_position(const hs_dynamic *list, const double *position, double *own)
{
    for (int k = 0; k < list->lattice.ndim; k++) {
        own[k] = ((const volatile double *)position)[k];
    }
}

/* storage.c */

/* No points, and no memory of them, in a list that has its lattice and axes; gives it back. */
void hs_stored_init(hs_dynamic *list, bool dense, double most_bytes);
void hs_stored_free(hs_dynamic *list);

/* The place of a key's entry, or HS_NO_PLACE. */
uint32_t hs_stored_find(const hs_dynamic *list, hs_key key);

#endif
