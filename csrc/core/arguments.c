/* SPDX-License-Identifier: BSD-3-Clause */
/* arguments.c: see arguments.h. */
#include "arguments.h"

#include <limits.h>

#define ALL_WANTS 63u /* every HS_WANT_ bit */

static hs_status
status_of(bool sound)
{
    return sound ? HS_OK : HS_ERR_ARGUMENT;
}

static bool
is_dimension(int ndim)
{
    return ndim >= 1 && ndim <= HS_MAX_DIM;
}

static bool
is_index_size(int bytes)
{
    return bytes == 4 || bytes == 8;
}

hs_status
hs_check_points(const hs_points *points)
{
    const bool is_read = points->n > 0 && points->n <= INT32_MAX;
    return status_of(is_dimension(points->ndim) && points->n >= 0 &&
                     (points->data != NULL || !is_read) &&
                     (points->real == HS_FLOAT32 || points->real == HS_FLOAT64));
}

hs_status
hs_check_box(const hs_box *box, int ndim)
{
    return status_of(box == NULL || (is_dimension(ndim) && box->ndim == ndim));
}

static bool
has_all(const hs_pair_arrays *out, unsigned want)
{
    return (!(want & HS_WANT_I) || out->i != NULL) && (!(want & HS_WANT_J) || out->j != NULL) &&
           (!(want & HS_WANT_BOTH) || out->both != NULL) &&
           (!(want & HS_WANT_DISTANCE) || out->distance != NULL) &&
           (!(want & HS_WANT_VECTOR) || out->vector != NULL) &&
           (!(want & HS_WANT_SHIFT) || out->shift != NULL);
}

/* Each array that is wanted is there, if anything is to be written to it. */
static bool
can_hold(const hs_pair_arrays *out, unsigned want)
{
    return is_index_size(out->index_bytes) && out->capacity >= 0 &&
           (out->capacity == 0 || has_all(out, want));
}

hs_status
hs_check_options(const hs_options *options)
{
    const unsigned        want = options->want;
    const hs_pair_arrays *out = options->out;
    return status_of((want & ~ALL_WANTS) == 0 &&
                     (want == 0 || is_index_size(options->index_bytes)) &&
                     (want == 0 || out == NULL || can_hold(out, want)) &&
                     options->threads > INT_MIN &&
                     options->cell_size >= 0.0 && options->memory_limit >= 0.0 &&
                     (options->precision == HS_EXACT || options->precision == HS_DOUBLE ||
                      options->precision == HS_SINGLE));
}

hs_status
hs_check_arguments(const hs_points *points, const hs_points *queries, const hs_box *box,
                   const hs_options *options)
{
    hs_status status = hs_check_points(points);
    if (status == HS_OK) {
        status = hs_check_box(box, points->ndim);
    }
    if (status == HS_OK && queries != NULL) {
        status = hs_check_points(queries);
        status = status == HS_OK ? status_of(queries->ndim == points->ndim) : status;
    }
    return status == HS_OK ? hs_check_options(options) : status;
}
