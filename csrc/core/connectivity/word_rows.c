/* SPDX-License-Identifier: BSD-3-Clause */
/* word_rows.c: a word begins wherever the next number is not of the present one. */
#include "word_rows.h"

/* Where each row begins; returns how many words there are. */
static int64_t
count_words(const hs_point_rows *from, int64_t *first)
{
    int64_t n = 0;
    for (int64_t k = 0; k < from->n; k++) {
        int32_t word = -1;
        first[k] = n;
        for (int64_t e = from->first[k]; e < from->first[k + 1]; e++) {
            const int32_t own = from->index[e] >> 6;
            n += own != word;
            word = own;
        }
    }
    first[from->n] = n;
    return n;
}

static void
fill_words(const hs_point_rows *from, hs_word_rows *rows)
{
    int64_t at = -1;
    for (int64_t k = 0; k < from->n; k++) {
        int32_t word = -1;
        for (int64_t e = from->first[k]; e < from->first[k + 1]; e++) {
            const int32_t own = from->index[e] >> 6;
            if (own != word) {
                rows->word[++at] = word = own;
                rows->bits[at] = 0;
            }
            rows->bits[at] |= UINT64_C(1) << (from->index[e] & 63);
        }
    }
}

hs_status
hs_word_rows_make(hs_account *account, const hs_point_rows *from, hs_word_rows *rows)
{
    *rows = (hs_word_rows){.first = NULL};
    rows->first = hs_alloc(account, HS_FOR_SORTING, from->n + 1, sizeof *rows->first);
    if (rows->first == NULL) {
        return HS_ERR_MEMORY;
    }
    const int64_t n = count_words(from, rows->first);
    rows->word = hs_alloc(account, HS_FOR_SORTING, n, sizeof *rows->word);
    rows->bits = hs_alloc(account, HS_FOR_SORTING, n, sizeof *rows->bits);
    if (rows->word == NULL || rows->bits == NULL) {
        hs_word_rows_free(account, rows);
        return HS_ERR_MEMORY;
    }
    fill_words(from, rows);
    return HS_OK;
}

void
hs_word_rows_free(hs_account *account, hs_word_rows *rows)
{
    hs_free(account, rows->first);
    hs_free(account, rows->word);
    hs_free(account, rows->bits);
    *rows = (hs_word_rows){.first = NULL};
}
