/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_COLLECT_COLUMNS_H
#define HS_COLLECT_COLUMNS_H

#include "../memory/results.h"
#include "../threads/call.h"

/* columns.h: the pairs that have been found, one growable column for each wanted quantity and none
 * for the others. What is written here is what the caller gets. */

typedef struct hs_output {
    hs_account *account; /* borrowed; NULL: neither counted nor limited */
    int         ndim;
    int         index_bytes; /* 4 or 8, of i, j and both */
    unsigned    columns;     /* HS_WANT_ bits that are kept */
    bool        fixed;       /* the columns are the caller's and do not grow */
    int64_t     n_pairs;     /* found; when fixed, also those that had no room */
    int64_t     capacity;    /* pairs that fit, HS_PADDING more beside them unless fixed */
    int64_t     charged;     /* pairs that the account has been charged for */
    hs_region   column[HS_QUANTITIES]; /* in the order of the HS_WANT_ bits */
} hs_output;

/* An empty output. */
void hs_output_init(hs_account *account, int ndim, unsigned columns, int index_bytes,
                    hs_output *output);

/* Bytes of one pair in the column of this HS_WANT_ bit. */
size_t hs_output_width(const hs_output *output, unsigned bit);

/* Bytes of one pair in all columns. */
int64_t hs_output_bytes_per_pair(const hs_output *output);

/* The column of this HS_WANT_ bit; NULL where it is not kept. */
void *hs_output_column(const hs_output *output, unsigned bit);

/* Whether -S of each pair is an int32, where S is kept, beside i and j of 4 bytes.
 * HS_ERR_SHIFT_RANGE: failure->row is j of the first pair of which it is not. */
hs_status hs_output_check_opposites(const hs_output *output, hs_failure *failure);

/* Room in the column of this HS_WANT_ bit for the next pair; NULL where it is not kept. */
void *hs_output_next(const hs_output *output, unsigned bit);

/*
 * Room for n more pairs. `fraction` of the search is done, from which the number in the end is
 * guessed; 0: unknown. HS_ERR_MEMORY when the account or the system refuses. Not for fixed outputs.
 */
hs_status hs_output_reserve(hs_output *output, int64_t n, double fraction);

/* Whether n more pairs fit as it is; a fixed output always takes what fits. */
bool hs_output_has_room(const hs_output *output, int64_t n);

/* Writes to each huge page that begins in the room of pairs [at, at + n), before several threads
 * write there: the system clears a new page for each thread that finds it missing, and keeps one.
 */
void hs_output_touch(hs_output *output, int64_t at, int64_t n);

/* Writes pairs [first, end) of `part`, which has the same columns, to place `at` on; a fixed output
 * takes what fits. */
void hs_output_copy(hs_output *output, int64_t at, const hs_output *part, int64_t first,
                    int64_t end);

/* Copies rows of a table, which are one behind another in `part` from its beginning: row[t] begins
 * at entry offsets[row[t]], and ends where the next one begins. Of the `known` >= n entries of
 * `row`, those behind the first n are the rows that will come next. */
void hs_output_place(const hs_output *output, const int64_t *offsets, const hs_output *part,
                     const int32_t *row, int64_t n, int64_t known);

/* n indices to every `stride`-th place of a column of 4 or 8 bytes each, from every `step`-th
 * number; step 0: all are the first one. column NULL: nothing. */
HS_ALWAYS_INLINE void
hs_put_indices(void *column, int index_bytes, const int64_t stride, const int32_t *numbers,
               const int64_t step, int64_t n)
{
    int32_t *HS_RESTRICT narrow = column;
    int64_t *HS_RESTRICT wide = column;
    for (int64_t e = 0; column != NULL && index_bytes == 4 && e < n; e++) {
        narrow[e * stride] = numbers[e * step];
    }
    for (int64_t e = 0; column != NULL && index_bytes == 8 && e < n; e++) {
        wide[e * stride] = (int64_t)(uint32_t)numbers[e * step]; /* cheaper than a sign */
    }
}

/* Virtual room for about n pairs, before the first: saves growing. Never fails. */
void hs_output_reserve_hint(hs_output *output, double n);

/* Idempotent. A fixed output is let go of. */
void hs_output_free(hs_output *output);

/*
 * Touches new memory before pairs are written to it in no particular order. Each page of new memory
 * is cleared by the system at the first write to it, a huge one in a millisecond or more. Where the
 * first thousand writes go to a thousand pages, the caller would not be polled for seconds.
 */

/* Writes to every page that begins in the columns' first n_pairs pairs, if these are so large that
 * it matters: what they hold is lost. HS_ERR_INTERRUPTED when the caller says so. */
hs_status hs_touch_output(hs_team *team, const hs_options *options, hs_output *output);

/* What a finished search is, for the functions of api/ that make one. */

struct hs_pairs {
    hs_call   call; /* which has ended: kept for its account */
    hs_output output;
    hs_output offsets; /* int64, where the rows of hs_neighbors_find begin; else nothing */
};

/* An empty result, whose call must be begun next. NULL when memory is short. */
hs_pairs *hs_pairs_new(void);

/* An empty output of the columns that the call wants, or the caller's arrays. */
void hs_pairs_open(hs_pairs *pairs, int ndim);

/* An output of n offsets, of which none is set, charged to `account`; *offsets is their array.
 * HS_OK or HS_ERR_MEMORY; it can be freed either way. */
hs_status hs_output_open_offsets(hs_account *account, int64_t n, hs_output *output,
                                 int64_t **offsets);

/* Leaves the call, which found n_pairs pairs. *result becomes the object, or that is freed. Returns
 * the status. */
hs_status hs_pairs_finish(hs_pairs *pairs, hs_status status, int64_t n_pairs, hs_pairs **result);

/* When a search ends with this status: arrays also where there are no pairs; HS_ERR_CAPACITY where
 * those of the caller had no room for all. */
hs_status hs_pairs_conclude(hs_output *output, hs_status status, hs_failure *failure);

#endif
