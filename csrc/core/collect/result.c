/* SPDX-License-Identifier: BSD-3-Clause */
/* result.c: makes the object of a finished search; the public functions that read it and take from
 * it. */
#include "result.h"

#include <string.h>

#include "../base/want.h"

hs_pairs *
hs_pairs_new(void)
{
    hs_pairs *pairs = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *pairs);
    if (pairs != NULL) {
        memset(&pairs->output, 0, sizeof pairs->output);
        memset(&pairs->offsets, 0, sizeof pairs->offsets);
    }
    return pairs;
}

void
hs_pairs_open(hs_pairs *pairs, int ndim)
{
    const hs_options *options = &pairs->call.options;
    hs_output_init(&pairs->call.account, ndim, options->want, options->index_bytes, &pairs->output);
    if (options->out != NULL) {
        hs_output_fix(&pairs->output, options->out);
    }
}

hs_status
hs_pairs_open_offsets(hs_account *account, int64_t n, hs_pairs *pairs, int64_t **offsets)
{
    hs_output_init(account, 1, HS_WANT_I, 8, &pairs->offsets);
    const hs_status status = hs_output_reserve(&pairs->offsets, n, 0.0);
    if (status == HS_OK) {
        pairs->offsets.n_pairs = n;
        *offsets = hs_output_column(&pairs->offsets, HS_WANT_I);
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
                  hs_output_charged(&pairs->output) + hs_output_charged(&pairs->offsets));
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

/* Whether it is exactly one HS_WANT_ bit. */
static bool
is_quantity(unsigned which)
{
    return hs_want_number(which) < HS_QUANTITIES;
}

const void *
hs_pairs_array(const hs_pairs *pairs, unsigned which)
{
    return pairs == NULL || pairs->output.fixed || !is_quantity(which)
               ? NULL
               : hs_output_column(&pairs->output, which);
}

void *
hs_pairs_take(hs_pairs *pairs, unsigned which)
{
    return pairs == NULL || pairs->output.fixed || !is_quantity(which)
               ? NULL
               : hs_output_take(&pairs->output, which);
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
    return pairs != NULL ? hs_output_take(&pairs->offsets, HS_WANT_I) : NULL;
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
