/* SPDX-License-Identifier: BSD-3-Clause */
/* word_rows.h: rows of numbers as bits, 64 numbers to a word. Where the numbers of a row are close
 * to each other, as those of neighbours are in the order of space, it has few words. */
#ifndef HS_WORD_ROWS_H
#define HS_WORD_ROWS_H

#include "point_rows.h"

/* Row k is the words [first[k], first[k + 1]): bits[w] are the numbers from 64 * word[w] on. All
 * are owned. */
typedef struct hs_word_rows {
    int64_t  *first;
    int32_t  *word; /* ascending in each row */
    uint64_t *bits;
} hs_word_rows;

/* Of rows that ascend. On failure holds nothing. */
hs_status hs_word_rows_make(hs_account *account, const hs_point_rows *from, hs_word_rows *rows);

/* Harmless twice. */
void hs_word_rows_free(hs_account *account, hs_word_rows *rows);

#endif
