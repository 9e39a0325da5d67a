/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_DYNAMIC_STORAGE_H
#define HS_DYNAMIC_STORAGE_H

#include "../../halfshell_dynamic.h"
#include "../base/base.h"
#include "../box/lattice.h"

#include <stdint.h>
#include <math.h>

/*
 * storage.h: where a dynamic list keeps its entries: blocks of them, a map of keys, and tables of
 * cells that are dense, or hold occupied cells only.
 */

/*
 * Where entries lie: in blocks of 1, 2, 4, ... of them, cut from one array that grows. A
 * block that is given back serves the next one of its size. An entry is known by its place, its
 * number in the array, which stays while the array grows.
 */

#define HS_NO_PLACE    UINT32_MAX
#define HS_ENTRY_SIZES 32 /* blocks of 2^0 ... 2^31 entries */

/* What follows the coordinates of an entry. */
typedef struct hs_entry_tail {
    int64_t  id;
    int32_t  tag;
    uint32_t cell;
} hs_entry_tail;

typedef struct hs_entries {
    int            ndim;
    size_t         stride; /* bytes of an entry: ndim doubles, then the tail */
    unsigned char *data;   /* owned */
    double        *given; /* owned: positions as given, ndim each; NULL: they are the coordinates */
    bool           keeps_given;
    uint32_t       n_used, capacity;      /* entries in blocks, past or present; that fit */
    uint32_t       spare[HS_ENTRY_SIZES]; /* first free block of each size, or HS_NO_PLACE */
} hs_entries;

void hs_entries_init(hs_entries *entries, int ndim, bool keeps_given);
void hs_entries_free(hs_entries *entries);

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
    return entries->keeps_given ? entries->given + (size_t)place * (size_t)entries->ndim
                                : hs_entry_at(entries, place);
}

/* The first place of a block of 2^size entries, or HS_NO_PLACE. */
uint32_t hs_entries_take(hs_entries *entries, int size);
void     hs_entries_give(hs_entries *entries, int size, uint32_t place);

/* Makes room for `more` entries in blocks to come: exactly so many where there were none. False
 * when memory is refused: then nothing has changed. */
bool hs_entries_reserve(hs_entries *entries, int64_t more);

/* Copies n entries to other places, also of other entries of the same kind. */
void hs_entries_copy(const hs_entries *source, uint32_t from, hs_entries *entries, uint32_t to,
                     uint32_t n);

int64_t hs_entries_bytes(const hs_entries *entries);

/*
 * From what has a hash to a number. Open addressing with linear probing: a row holds the number and
 * 32 bits of the hash, its mark, which say where the row belongs; what was hashed is looked up by
 * the number.
 */

#define HS_NO_NUMBER UINT32_MAX

typedef struct hs_hash_row {
    uint32_t number; /* HS_NO_NUMBER: the row is free */
    uint32_t mark;
} hs_hash_row;

typedef struct hs_hash {
    hs_hash_row *rows;   /* owned */
    int64_t      n_rows; /* 0, or a power of two; at most three quarters are in use */
} hs_hash;

/* Room for n numbers in all; false when memory is refused: then nothing has changed. */
bool    hs_hash_reserve(hs_hash *hash, int64_t n);
int64_t hs_hash_bytes(const hs_hash *hash);

/* From a key to the place of its entry, which holds the key itself. Removal closes the gap, so that
 * no row is ever wasted on keys that are gone. */
typedef struct hs_key_map {
    hs_hash hash; /* numbers are places */
    int64_t n;    /* keys */
} hs_key_map;

/* Bits of a key in which each depends on all of it: the finaliser of SplitMix64 (Steele, Lea and
 * Flood, OOPSLA 2014). */
HS_ALWAYS_INLINE uint32_t
hs_key_mark(hs_key key)
{
    uint64_t x = (uint64_t)key.id + (uint64_t)(uint32_t)key.tag * UINT64_C(0x9E3779B97F4A7C15);
    x = (x ^ (x >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    x = (x ^ (x >> 27)) * UINT64_C(0x94D049BB133111EB);
    return (uint32_t)(x >> 32);
}

void hs_key_map_free(hs_key_map *map);

/* The place of a key's entry, or HS_NO_PLACE. */
uint32_t hs_key_map_find(const hs_key_map *map, const hs_entries *entries, hs_key key);

/* A key is about to be added. */
void hs_key_map_expect(const hs_key_map *map, hs_key key);

/* Adds a key that is not there; hs_hash_reserve has made room. */
void hs_key_map_add(hs_key_map *map, hs_key key, uint32_t place);

/* The entry of a key was at `from`, and is at `to` now. */
void hs_key_map_moved(hs_key_map *map, hs_key key, uint32_t from, uint32_t to);

/* Removes the key whose entry is at `place`. */
void hs_key_map_remove(hs_key_map *map, hs_key key, uint32_t place);

/* Is a key twice among those that a caller gives? */

/* The first of n keys that came before among them, or -1; -2: out of memory. tags: or NULL. */
int64_t hs_repeated_key(const int64_t *ids, const int32_t *tags, int64_t n);

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

typedef struct hs_axes {
    int     ndim;
    hs_axis axis[HS_MAX_DIM];
} hs_axes;

/* Cells that a ball meets along one axis. */
typedef struct hs_span_of_cells {
    int64_t first, last; /* u of cells; last < first: none */
    int64_t least, most; /* images */
    int64_t centre;      /* u of the centre's cell */
} hs_span_of_cells;

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

/* cell_size: least width, where `one_cell` is false. max_radius: of queries. */
void hs_axes_init(hs_axes *axes, const hs_lattice *lattice, double cell_size, bool one_cell,
                  double max_radius);

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

/* A double at most x - y, and one at least x + y. Where they are subnormal, the sum was exact. */
HS_ALWAYS_INLINE double
hs_below(double x, double y)
{
    const double sum = x - y;
    return sum - fabs(sum) * 0x1p-52;
}

HS_ALWAYS_INLINE double
hs_above(double x, double y)
{
    const double sum = x + y;
    return sum + fabs(sum) * 0x1p-52;
}

/* The cells of a ball that meets other images: less than 2^30 of them. low, high: its ends, rounded
 * outwards; error: what coordinates may be wrong by. Sets all but the centre. */
void hs_axis_images(const hs_axis *axis, double low, double high, double error,
                    hs_span_of_cells *span);

/* The cells of a ball. t: its centre, in the middle period but for rounding, and in the cell
 * `centre`; radius: with the error. */
HS_ALWAYS_INLINE void
hs_axis_span(const hs_axis *axis, double t, int64_t centre, double radius, double error,
             hs_span_of_cells *span)
{
    const double low = hs_below(t, radius), high = hs_above(t, radius);
    span->centre = centre;
    if (axis->n == 0 || (low >= -axis->half + error && high <= axis->half - error)) {
        span->first = hs_axis_cell(axis, low);
        span->last = hs_axis_cell(axis, high);
        span->least = span->most = 0;
    } else {
        hs_axis_images(axis, low, high, error, span);
    }
}

/* Cell and image of u. */
HS_ALWAYS_INLINE int64_t
hs_axis_image(const hs_axis *axis, int64_t u)
{
    if (axis->n == 0 || (uint64_t)u < (uint64_t)axis->n) {
        return 0;
    }
    return u >= 0 ? u / axis->n : -((-u - 1) / axis->n) - 1;
}

/*
 * At most the square of the distance along the axis from t to the points of cell u; 0 where that is
 * not known to be more. An edge at u * width - half is computed with three roundings, and an index
 * with three more: 2^-44 of all that goes into them is a hundred times as much.
 */
HS_ALWAYS_INLINE double
hs_axis_gap(const hs_axis *axis, double t, int64_t u, int64_t centre)
{
    if (u == centre || axis->inverse == 0.0) {
        return 0.0;
    }
    const double edge = (double)(u + (u < centre)) * axis->width;
    const double distance = u > centre ? (edge - axis->half) - t : t - (edge - axis->half);
    const double gap = distance - 0x1p-44 * (fabs(edge) + fabs(t) + axis->half + axis->width);
    return gap > 0.0 ? gap * gap : 0.0;
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

/* most_bytes: that a dense table may take. */
void hs_cell_table_init(hs_cell_table *table, const hs_axes *axes, bool dense, double most_bytes);

/* Gives all cells back; blocks are left to the caller. */
void hs_cell_table_free(hs_cell_table *table);

/*
 * Makes room for cells to come; the numbers of others may change, and entries get those of theirs.
 * Sparse: for so many more. Dense: makes the table reach from `first` to `last` along open axes;
 * farther than that by half of what it was, if its most bytes allow it. HS_ERR_MEMORY, or
 * HS_ERR_CAPACITY, which sets expected_bytes and limit_bytes: then nothing has changed.
 */
hs_status hs_cell_table_reserve(hs_cell_table *table, hs_entries *entries, const int64_t *first,
                                const int64_t *last, int64_t more, hs_failure *failure);

/* The cell with these indices, or HS_NO_CELL. */
uint32_t hs_cell_table_find(const hs_cell_table *table, const int64_t *index);

/* The same; where there is none, it is added. Statuses and effects of hs_cell_table_reserve. */
hs_status hs_cell_table_add(hs_cell_table *table, hs_entries *entries, const int64_t *index,
                            uint32_t *number, hs_failure *failure);

/* The indices of a cell, in sparse tables modulo 2^32. */
void hs_cell_table_index(const hs_cell_table *table, uint32_t cell, int64_t *index);

int64_t hs_cell_table_bytes(const hs_cell_table *table);

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

/* The cell with these indices and the mark that they have. */
HS_ALWAYS_INLINE uint32_t
hs_cell_table_probe(const hs_cell_table *table, const int64_t *index, uint32_t mark)
{
    const int64_t last = table->hash.n_rows - 1;
    if (last < 0) {
        return HS_NO_CELL;
    }
    for (int64_t r = mark & (uint64_t)last;; r = (r + 1) & last) {
        const hs_hash_row row = table->hash.rows[r];
        if (row.number == HS_NO_NUMBER) {
            return HS_NO_CELL;
        }
        if (row.mark == mark) {
            const int32_t *found = table->index + (int64_t)row.number * table->ndim;
            int            k = 0;
            while (k < table->ndim && found[k] == (int32_t)(uint32_t)index[k]) {
                k++;
            }
            if (k == table->ndim) {
                return row.number;
            }
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

/* Lists for balls up to this radius, as far as they are not too long. False when memory is
 * refused. */
bool hs_offsets_init(hs_offsets *offsets, const hs_axes *axes, const hs_lattice *lattice,
                     double max_radius);
bool hs_offsets_copy(const hs_offsets *offsets, hs_offsets *copy);
void hs_offsets_free(hs_offsets *offsets);

#endif
