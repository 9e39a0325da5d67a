/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * cell_table.h: from the indices of a cell to its entries. Either every cell between the outermost
 * has a number by its place in the grid (dense), or those that have been occupied are numbered as
 * they come, and a hash table knows them (sparse). A sparse table that is full drops its empty
 * cells before it grows, if half of them are empty, or if memory is refused.
 */
#ifndef HS_CELL_TABLE_H
#define HS_CELL_TABLE_H

#include "cell_axes.h"
#include "entries.h"

#define HS_NO_CELL  UINT32_MAX
#define HS_NO_BLOCK UINT8_MAX

typedef struct hs_cell {
    uint32_t start, count; /* places start to start + count - 1 */
} hs_cell;

typedef struct hs_cell_row {
    uint32_t cell; /* HS_NO_CELL: none */
    uint32_t mark;
} hs_cell_row;

typedef struct hs_cell_table {
    bool     dense;
    int      ndim;
    int64_t  n;        /* cells */
    int64_t  capacity; /* of the next three */
    hs_cell *cell;     /* owned */
    uint8_t *size;     /* owned: a block has 2^size entries; HS_NO_BLOCK: there is none */
    int32_t *index;    /* owned, sparse: ndim a cell, the indices modulo 2^32 */
    /* sparse */
    hs_cell_row *rows;    /* owned */
    int64_t      n_rows;  /* 0, or a power of two */
    int64_t      n_empty; /* cells without entries */
    bool         is_wide; /* some index was beyond int32, so that cells may be shared */
    /* dense */
    int64_t lowest[HS_MAX_DIM], shape[HS_MAX_DIM], stride[HS_MAX_DIM];
} hs_cell_table;

void hs_cell_table_init(hs_cell_table *table, const hs_axes *axes, bool dense);

/* Gives all cells back; blocks are left to the caller. */
void hs_cell_table_free(hs_cell_table *table);

/* Bytes of a dense table of so many cells. */
#define HS_DENSE_CELL_BYTES (sizeof(hs_cell) + sizeof(uint8_t))

/*
 * Dense: makes the table reach from `first` to `last` along open axes, and gives the entries their
 * new cells. Farther than that by half of what it was, if `most` bytes allow it. HS_ERR_MEMORY, or
 * HS_ERR_CAPACITY with the bytes: then nothing has changed.
 */
hs_status hs_cell_table_extend(hs_cell_table *table, hs_entries *entries, const int64_t *first,
                               const int64_t *last, double most, double *bytes);

/* The cell with these indices, or HS_NO_CELL. */
uint32_t hs_cell_table_find(const hs_cell_table *table, const int64_t *index);

/* The same; a sparse table adds it. HS_NO_CELL when memory is refused. The numbers of other cells
 * may change. */
uint32_t hs_cell_table_add(hs_cell_table *table, hs_entries *entries, const int64_t *index);

/* Sparse: makes room for so many cells more, whose numbers will then stay. */
bool hs_cell_table_reserve(hs_cell_table *table, hs_entries *entries, int64_t more);

/* Sparse: adds a cell that is not there, for which there is room. */
uint32_t hs_cell_table_append(hs_cell_table *table, const int64_t *index);

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
    if (table->n_rows == 0) {
        return HS_NO_CELL;
    }
    for (int64_t r = mark & (uint64_t)(table->n_rows - 1);; r = (r + 1) & (table->n_rows - 1)) {
        const hs_cell_row row = table->rows[r];
        if (row.cell == HS_NO_CELL) {
            return HS_NO_CELL;
        }
        if (row.mark == mark) {
            const int32_t *found = table->index + (int64_t)row.cell * table->ndim;
            int            k = 0;
            while (k < table->ndim && found[k] == (int32_t)(uint32_t)index[k]) {
                k++;
            }
            if (k == table->ndim) {
                return row.cell;
            }
        }
    }
}

#endif
