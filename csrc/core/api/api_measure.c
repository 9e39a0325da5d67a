/* SPDX-License-Identifier: BSD-3-Clause */
/* api_measure.c: the public function that measures pairs which the caller has. */
#include "../collect/given_pairs.h"
#include "request.h"

/* Pairs that take about as long as a point of a search with few neighbours. */
#define PAIRS_A_POINT 8

static hs_status
check(const hs_points *points, const hs_box *box, const hs_pair_numbers *pairs,
      const hs_options *options, hs_failure *failure)
{
    const hs_status status = hs_check_arguments(points, NULL, box, options, failure);
    if (status != HS_OK) {
        return status;
    }
    if (pairs == NULL || pairs->n < 0 || pairs->n > INT64_MAX / 1024 ||
        (pairs->n > 0 && (pairs->i == NULL || pairs->j == NULL))) {
        return HS_ERR_ARGUMENT;
    }
    return hs_box_check(box, failure);
}

/* Once the arguments are sound. */
static hs_status
measure(const hs_points *points, const hs_box *box, const hs_pair_numbers *pairs, hs_pairs *result,
        hs_failure *failure)
{
    hs_call     *call = &result->call;
    hs_cloud     cloud;
    hs_image_box images;
    hs_status    status = hs_image_box_init(box, points->ndim, &images);
    if (status == HS_ERR_BOX_SKEWED && pairs->shift != NULL) {
        status = HS_OK; /* no image is looked for */
    }
    if (status == HS_OK && call->kernel == NULL) {
        status = HS_ERR_KERNEL;
    }
    if (status != HS_OK) {
        return status;
    }
    hs_call_gather(call, points->n + pairs->n / PAIRS_A_POINT);
    status = hs_cloud_load(&call->account, call->team, points, &call->options, &cloud, failure);
    if (status != HS_OK) {
        return status;
    }
    status = hs_output_reserve(&result->output, pairs->n, 0.0);
    if (status == HS_OK) {
        const hs_given_pairs given = {pairs, &cloud, &images, &result->output};
        result->output.n_pairs = pairs->n;
        status = hs_given_pairs_measure(&given, call, failure);
    } else {
        failure->expected_pairs = (double)pairs->n;
        failure->expected_bytes =
            (double)pairs->n * (double)hs_output_bytes_per_pair(&result->output);
    }
    hs_cloud_free(&call->account, &cloud);
    return status;
}

hs_status
hs_measure(const hs_points *points, const hs_box *box, const hs_pair_numbers *pairs,
           const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    if (!hs_can_return(result, options)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_options of_pairs = *options;
    of_pairs.cutoff = 0.0;
    of_pairs.cell_size = 0.0;
    of_pairs.sorted = false;
    of_pairs.out = NULL;
    of_pairs.precision = HS_EXACT;
    of_pairs.algorithm = HS_AUTO;
    of_pairs.index_bytes = 8;
    of_pairs.want &= HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT;
    hs_pairs *measured = hs_pairs_begin(&of_pairs, &failure);
    if (measured == NULL) {
        return HS_ERR_MEMORY;
    }
    hs_status status = check(points, box, pairs, &of_pairs, failure);
    if (status == HS_OK) {
        hs_pairs_open(measured, points->ndim);
        status = measure(points, box, pairs, measured, failure);
    }
    hs_call_tell_limit(&measured->call, status, failure);
    return hs_pairs_finish(measured, status, measured->output.n_pairs, result);
}
