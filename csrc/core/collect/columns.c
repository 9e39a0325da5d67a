/* SPDX-License-Identifier: BSD-3-Clause */
#include "columns.h"

#include <math.h>
#include <string.h>

/* columns.c: columns grow together, by a guess of the number of pairs in the end. */

/* Pairs that the first columns hold: they come from the pool and are soon warm. */
#define FIRST_CAPACITY 1024
/* A guess of the number of pairs is made this much larger, so that most of the time one
 * reservation is enough. Room that is not written to costs nothing. */
#define GUESS_MARGIN 1.06
#define MOST_GROWTH  8.0
/* Pairs that the account is charged for at a time. */
#define CHARGE_STEP (INT64_C(1) << 20)
/* Bytes of a column that does not stay in the caches until the caller reads it. */
#define LEAST_BYPASSED 0x1p24
/* Most bytes of one column: half the address space. */
#define MOST_BYTES (0.5 * (double)SIZE_MAX)

void
hs_output_init(hs_account *account, int ndim, unsigned columns, int index_bytes, hs_output *output)
{
    memset(output, 0, sizeof *output);
    output->account = account;
    output->ndim = ndim;
    output->columns = columns;
    output->index_bytes = index_bytes;
}

size_t
hs_output_width(const hs_output *output, unsigned bit)
{
    return (size_t)hs_want_bytes(bit, output->ndim, output->index_bytes);
}

void *
hs_output_column(const hs_output *output, unsigned bit)
{
    return output->columns & bit ? output->column[hs_want_number(bit)].data : NULL;
}

hs_status
hs_output_check_opposites(const hs_output *output, hs_failure *failure)
{
    const int32_t *shift = hs_output_column(output, HS_WANT_SHIFT);
    const int32_t *j = hs_output_column(output, HS_WANT_J);
    int32_t        least = 0;
    for (int64_t e = 0; shift != NULL && e < output->n_pairs * output->ndim; e++) {
        least = shift[e] < least ? shift[e] : least;
    }
    for (int64_t e = 0; least == INT32_MIN; e++) {
        if (shift[e] == INT32_MIN) {
            failure->row = j[e / output->ndim];
            return HS_ERR_SHIFT_RANGE;
        }
    }
    return HS_OK;
}

void *
hs_output_next(const hs_output *output, unsigned bit)
{
    char *column = hs_output_column(output, bit);
    return column == NULL ? NULL : column + (size_t)output->n_pairs * hs_output_width(output, bit);
}

/* Gives back what some columns got where another was refused: it may be what that one lacks. */
static void
undo_resize(hs_output *output)
{
    for (int k = 0; k < HS_QUANTITIES; k++) {
        hs_region *column = &output->column[k];
        if (output->capacity == 0) {
            hs_region_release(column);
        } else if (column->data != NULL) {
            hs_region_shrink(column, ((size_t)output->capacity + HS_PADDING) *
                                         hs_output_width(output, 1u << k));
        }
    }
}

/* Columns of at least `pairs` pairs and the padding; as before if that is refused. */
static bool
resize(hs_output *output, double pairs)
{
    for (int k = 0; k < HS_QUANTITIES; k++) {
        hs_region *column = &output->column[k];
        if (!(output->columns >> k & 1u)) {
            continue;
        }
        const size_t width = hs_output_width(output, 1u << k);
        /* as double first: size_t may have 32 bits */
        if (!((pairs + HS_PADDING) * (double)width < MOST_BYTES)) {
            undo_resize(output);
            return false;
        }
        const size_t bytes = ((size_t)pairs + HS_PADDING) * width;
        column->used = (size_t)output->n_pairs * width;
        if (column->data == NULL ? !hs_region_reserve(column, bytes)
                                 : column->capacity < bytes && !hs_region_grow(column, bytes)) {
            undo_resize(output);
            return false;
        }
        hs_region_advise(column, bytes);
    }
    output->capacity = (int64_t)pairs;
    return true;
}

int64_t
hs_output_bytes_per_pair(const hs_output *output)
{
    return hs_want_bytes(output->columns, output->ndim, output->index_bytes);
}

/* Whether the account has room for n pairs. */
static bool
may_charge(const hs_output *output, int64_t n)
{
    const double more = (double)n - (double)output->charged;
    return output->account == NULL || more <= 0.0 ||
           hs_account_allows(output->account, more * (double)hs_output_bytes_per_pair(output));
}

/* The account knows of as many pairs as are about to be written, not of what is only reserved:
 * of n, which are more than it knows of. */
static bool
charge(hs_output *output, int64_t n)
{
    hs_account   *account = output->account;
    const int64_t more = n - output->charged;
    if (account == NULL) {
        return true;
    }
    if (!may_charge(output, n)) {
        return false;
    }
    for (int k = 0; k < HS_QUANTITIES; k++) {
        if (output->columns >> k & 1u) {
            hs_account_take(account, hs_want_purpose(k),
                            more * (int64_t)hs_output_width(output, 1u << k));
        }
    }
    output->charged = n;
    return true;
}

void
hs_output_reserve_hint(hs_output *output, double n)
{
    const double guess = n * GUESS_MARGIN + FIRST_CAPACITY;
    if (!(guess < 0x1p40) || !resize(output, guess)) {
        (void)resize(output, FIRST_CAPACITY); /* refused: grow as pairs come */
    }
}

hs_status
hs_output_reserve(hs_output *output, int64_t n, double fraction)
{
    const int64_t needed = output->n_pairs + n;
    if (!may_charge(output, needed)) { /* before the system allocates it */
        return HS_ERR_MEMORY;
    }
    if (needed > output->capacity || output->capacity == 0) {
        /* What is needed now, half as much again, or the whole as far as it can be foreseen. */
        const double least = (double)needed + FIRST_CAPACITY;
        const double grown = fmax(least, 1.5 * (double)output->capacity);
        const double guess = fraction > 0.0 ? GUESS_MARGIN * (double)output->n_pairs / fraction
                                            : 0.0;
        const double bold = fmin(guess, MOST_GROWTH * least); /* early fractions tell little */
        if (!resize(output, fmax(grown, bold)) && !resize(output, grown) &&
            !resize(output, least)) {
            return HS_ERR_MEMORY;
        }
    }
    if (needed > output->charged) {
        const int64_t step = output->n_pairs < CHARGE_STEP ? output->n_pairs : CHARGE_STEP;
        if (!charge(output, needed + step) && !charge(output, needed)) {
            return HS_ERR_MEMORY;
        }
    }
    return HS_OK;
}

bool
hs_output_has_room(const hs_output *output, int64_t n)
{
    const int64_t needed = output->n_pairs + n;
    return output->fixed || (needed <= output->capacity && output->capacity > 0 &&
                             (output->account == NULL || needed <= output->charged));
}

/* Of n pairs from `at` on, those that there is room for. */
static int64_t
fitting(const hs_output *output, int64_t at, int64_t n)
{
    return output->fixed && n > output->capacity - at ? output->capacity - at : n;
}

/* Writes to each page of so many bytes that begins in the room of pairs [at, at + n). */
static void
touch_pages(const hs_output *output, int64_t at, int64_t n, size_t page)
{
    for (int k = 0; n > 0 && k < HS_QUANTITIES; k++) {
        if (output->columns >> k & 1u) {
            const size_t width = hs_output_width(output, 1u << k), n_bytes = (size_t)n * width;
            char        *from = output->column[k].data + (size_t)at * width;
            for (size_t b = (size_t)(-(uintptr_t)from & (page - 1)); b < n_bytes; b += page) {
                *(volatile char *)(from + b) = 0; /* never read, but must be written */
            }
        }
    }
}

void
hs_output_touch(hs_output *output, int64_t at, int64_t n)
{
    touch_pages(output, at, fitting(output, at, n), HS_PAGES_FROM);
}

/* Bytes of the smallest pages there are. Larger ones are written to several times, which costs
 * little. */
#define PAGE 4096
/* Fewer bytes are cleared in a tenth of a second. */
#define LEAST_TOUCHED (INT64_C(1) << 26)

/* A hs_slab_fn. */
static hs_status
touch_strip(void *output, int strip, int64_t first, int64_t last)
{
    (void)strip;
    touch_pages(output, first, last - first, PAGE);
    return HS_OK;
}

hs_status
hs_touch_output(hs_team *team, const hs_options *options, hs_output *output)
{
    const int64_t n = output->n_pairs;
    const int     n_strips = hs_strips_for(team, n, 1, 0); /* far apart: no two share a page */
    return n * hs_output_bytes_per_pair(output) < LEAST_TOUCHED
               ? HS_OK
               : hs_walk_points(team, options, n, n_strips, touch_strip, output);
}

void
hs_output_copy(hs_output *output, int64_t at, const hs_output *part, int64_t first, int64_t end)
{
    const int64_t n = fitting(output, at, end - first);
    for (int k = 0; n > 0 && k < HS_QUANTITIES; k++) {
        if (output->columns >> k & 1u) {
            const size_t width = hs_output_width(output, 1u << k), n_bytes = (size_t)n * width;
            char        *to = output->column[k].data + (size_t)at * width;
            const char  *from = part->column[k].data + (size_t)first * width;
            /* Past the caches where they will not stay there, and are not there because the system
             * has just cleared new pages. */
            if ((double)output->capacity * (double)width >= LEAST_BYPASSED &&
                (output->fixed ||
                 (size_t)(at + n) * width <= hs_region_resident(&output->column[k]))) {
                hs_bypass_copy(to, from, n_bytes);
            } else {
                memcpy(to, from, n_bytes);
            }
        }
    }
    hs_bypass_end();
}

#define ROWS_AHEAD 16 /* rows from prefetching a place to writing there */

void
hs_output_place(const hs_output *output, const int64_t *offsets, const hs_output *part,
                const int32_t *row, int64_t n, int64_t known)
{
    for (int k = 0; k < HS_QUANTITIES && part->n_pairs > 0; k++) {
        const int64_t n_rows = output->columns >> k & 1u ? n : 0;
        const size_t  width = hs_output_width(output, 1u << k);
        const bool    bypass = (double)output->capacity * (double)width >= LEAST_BYPASSED;
        char         *column = output->column[k].data;
        const char   *from = part->column[k].data;
        for (int64_t t = 0; t < n_rows; t++) {
            const int64_t *place = offsets + row[t];
            const size_t   n_bytes = (size_t)(place[1] - place[0]) * width;
            char          *to = column + (size_t)place[0] * width;
            if (t + 2 * ROWS_AHEAD < known) {
                HS_PREFETCH(offsets + row[t + 2 * ROWS_AHEAD]);
            }
            if (t + ROWS_AHEAD < known) {
                const int64_t *next = offsets + row[t + ROWS_AHEAD];
                const char    *line = column + (size_t)next[0] * width;
                const char    *end = column + (size_t)next[1] * width;
                /* The lines of a row that it shares with others, or all of them; the others are
                 * written whole past the caches. */
                for (; line < end && !bypass; line += HS_ALIGNMENT) {
                    HS_PREFETCH_WRITE(line);
                }
                HS_PREFETCH_WRITE(line);
                HS_PREFETCH_WRITE(end);
            }
            if (bypass) {
                hs_bypass_copy(to, from, n_bytes);
            } else {
                memcpy(to, from, n_bytes);
            }
            from += n_bytes;
        }
    }
    hs_bypass_end();
}

/* Ownership of one column, cut to n_pairs, goes to the caller: hs_buffer_free. NULL where it is not
 * kept. */
static void *
output_take(hs_output *output, unsigned bit)
{
    if (!(output->columns & bit)) {
        return NULL;
    }
    const int k = hs_want_number(bit);
    output->columns &= ~bit;
    hs_region *column = &output->column[k];
    column->used = (size_t)output->n_pairs * hs_output_width(output, bit);
    return hs_region_detach(column, column->used);
}

/* Bytes that the account has been charged for. */
static int64_t
output_charged(const hs_output *output)
{
    return output->charged > 0 ? output->charged * hs_output_bytes_per_pair(output) : 0;
}

void
hs_output_free(hs_output *output)
{
    const unsigned owned = output->fixed ? 0 : output->columns;
    if (output->account != NULL) {
        hs_account_give(output->account, output_charged(output));
    }
    for (int k = 0; k < HS_QUANTITIES; k++) {
        hs_region *column = &output->column[k];
        if (owned >> k & 1u) {
            column->used = (size_t)output->n_pairs * hs_output_width(output, 1u << k);
            hs_region_release(column);
        }
    }
    output->columns = 0;
    output->charged = 0;
}

/* Makes the object of a finished search; the public functions that read it and take from
 * it. */

hs_pairs *
hs_pairs_new(void)
{
    hs_pairs *pairs = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *pairs);
    if (pairs != NULL) {
        pairs->output = pairs->offsets = (hs_output){.account = NULL};
    }
    return pairs;
}

void
hs_pairs_open(hs_pairs *pairs, int ndim)
{
    const hs_options *options = &pairs->call.options;
    hs_output_init(&pairs->call.account, ndim, options->want, options->index_bytes, &pairs->output);
    if (options->out != NULL) { /* writes to the caller's arrays */
        const hs_pair_arrays *out = options->out;
        void *const data[HS_QUANTITIES] = {out->i,     out->j,    out->distance, out->vector,
                                           out->shift, out->both, out->shell};
        for (int k = 0; k < HS_QUANTITIES; k++) {
            pairs->output.column[k] = (hs_region){.data = data[k]};
        }
        pairs->output.fixed = true;
        pairs->output.capacity = out->capacity;
        pairs->output.index_bytes = out->index_bytes;
    }
}

hs_status
hs_output_open_offsets(hs_account *account, int64_t n, hs_output *output, int64_t **offsets)
{
    hs_output_init(account, 1, HS_WANT_I, 8, output);
    const hs_status status = hs_output_reserve(output, n, 0.0);
    if (status == HS_OK) {
        output->n_pairs = n;
        *offsets = hs_output_column(output, HS_WANT_I);
    }
    return status;
}

hs_status
hs_pairs_finish(hs_pairs *pairs, hs_status status, int64_t n_pairs, hs_pairs **result)
{
    hs_account *account = &pairs->call.account;
    hs_call_leave(&pairs->call, n_pairs);
    hs_call_detach(&pairs->call);
    if (status == HS_OK) { /* no block is left: the next call may have the arena */
        HS_ASSERT(account->held ==
                  output_charged(&pairs->output) + output_charged(&pairs->offsets));
        hs_account_close(account);
        *result = pairs;
    } else {
        hs_pairs_free(pairs);
    }
    return status;
}

hs_status
hs_pairs_conclude(hs_output *output, hs_status status, hs_failure *failure)
{
    if (status != HS_OK) {
        return status;
    }
    if (!output->fixed) {
        return hs_output_reserve(output, 0, 1.0);
    }
    if (output->n_pairs > output->capacity) {
        failure->expected_pairs = (double)output->n_pairs;
        return HS_ERR_CAPACITY;
    }
    return HS_OK;
}

int64_t
hs_pairs_length(const hs_pairs *pairs)
{
    return pairs != NULL ? pairs->output.n_pairs : 0;
}

/* Whether it is exactly one HS_WANT_ bit, of columns that are not the caller's. */
static bool
is_own(const hs_pairs *pairs, unsigned which)
{
    return pairs != NULL && !pairs->output.fixed && hs_want_number(which) < HS_QUANTITIES;
}

const void *
hs_pairs_array(const hs_pairs *pairs, unsigned which)
{
    return is_own(pairs, which) ? hs_output_column(&pairs->output, which) : NULL;
}

void *
hs_pairs_take(hs_pairs *pairs, unsigned which)
{
    return is_own(pairs, which) ? output_take(&pairs->output, which) : NULL;
}

int64_t
hs_pairs_rows(const hs_pairs *pairs)
{
    return pairs != NULL && pairs->offsets.columns != 0 ? pairs->offsets.n_pairs - 1 : 0;
}

const int64_t *
hs_pairs_offsets(const hs_pairs *pairs)
{
    return pairs != NULL ? hs_output_column(&pairs->offsets, HS_WANT_I) : NULL;
}

int64_t *
hs_pairs_take_offsets(hs_pairs *pairs)
{
    return pairs != NULL ? output_take(&pairs->offsets, HS_WANT_I) : NULL;
}

void
hs_array_free(void *array)
{
    hs_buffer_free(array);
}

void
hs_pairs_free(hs_pairs *pairs)
{
    if (pairs == NULL) {
        return;
    }
    hs_output_free(&pairs->output);
    hs_output_free(&pairs->offsets);
    hs_account_close(&pairs->call.account);
    hs_free(NULL, pairs);
}
