/* SPDX-License-Identifier: BSD-3-Clause */
/* snapshot.c: one pass that copies each point, then finds the largest coordinate in the copy. */
#include "snapshot.h"

#include "../base/poll.h"

#include <math.h>
#include <string.h>

/* Independent chains of the loop over all entries: one would wait for itself. */
#define CHAINS 4

/* Points [first, last), one behind another. */
static void
copy_rows(const hs_points *points, int64_t first, int64_t last, char *to)
{
    const size_t size = points->real == HS_FLOAT32 ? sizeof(float) : sizeof(double);
    const size_t row_size = size * (size_t)points->ndim;
    const bool   packed = points->column_stride == (ptrdiff_t)size || points->ndim == 1;
    to += (size_t)first * row_size;
    if (packed && points->row_stride == (ptrdiff_t)row_size) {
        memcpy(to, (const char *)points->data + first * points->row_stride,
               (size_t)(last - first) * row_size);
        return;
    }
    for (int64_t i = first; i < last; i++) { /* no address behind the last point: it may overflow */
        const char *row = (const char *)points->data + i * points->row_stride;
        for (int k = 0; k < points->ndim; k++, to += size) {
            memcpy(to, row + k * points->column_stride, size);
        }
    }
}

/* Largest |x| of entries [first, last), or NaN if one is not finite. */
HS_ALWAYS_INLINE double
find_largest(const void *rows, const hs_real real, int64_t first, int64_t last)
{
    double  largest[CHAINS] = {0.0}, poison[CHAINS] = {0.0};
    int64_t e = first;
    for (; e + CHAINS <= last; e += CHAINS) {
        for (int c = 0; c < CHAINS; c++) {
            const double x = hs_frame_entry(rows, real, e + c);
            largest[c] = hs_larger(fabs(x), largest[c]);
            poison[c] += x - x;
        }
    }
    for (; e < last; e++) {
        const double x = hs_frame_entry(rows, real, e);
        largest[0] = hs_larger(fabs(x), largest[0]);
        poison[0] += x - x;
    }
    return hs_larger(hs_larger(largest[0], largest[1]), hs_larger(largest[2], largest[3])) +
           (poison[0] + poison[1] + poison[2] + poison[3]);
}

static hs_status
name_first_bad(const hs_frame *frame, int64_t first, int64_t last, hs_failure *failure)
{
    for (int64_t e = first; e < last; e++) {
        const double x = hs_frame_entry(frame->rows, frame->points.real, e);
        if (!isfinite(x)) {
            failure->row = e / frame->points.ndim;
            failure->column = e % frame->points.ndim;
            failure->value = x;
            break;
        }
    }
    return HS_ERR_NOT_FINITE;
}

static hs_status
take_points(const hs_points *points, const hs_options *options, hs_frame *frame,
            hs_failure *failure)
{
    const int64_t d = points->ndim;
    frame->largest = 0.0;
    for (int64_t first = 0; first < points->n; first += HS_POLL_POINTS) {
        const int64_t left = points->n - first;
        const int64_t last = first + (left < HS_POLL_POINTS ? left : HS_POLL_POINTS);
        copy_rows(points, first, last, frame->rows);
        const double largest = points->real == HS_FLOAT32
                                   ? find_largest(frame->rows, HS_FLOAT32, first * d, last * d)
                                   : find_largest(frame->rows, HS_FLOAT64, first * d, last * d);
        if (!isfinite(largest)) {
            return name_first_bad(frame, first * d, last * d, failure);
        }
        frame->largest = hs_larger(largest, frame->largest);
        if (left > HS_POLL_POINTS && hs_poll(options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

hs_status
hs_frame_take(const hs_points *points, const hs_box *box, const hs_options *options,
              hs_frame *frame, hs_failure *failure)
{
    const size_t size = points->real == HS_FLOAT32 ? sizeof(float) : sizeof(double);
    const size_t row_size = size * (size_t)points->ndim;
    frame->rows = hs_store_reserve(&frame->store, HS_FOR_POINTS, points->n, row_size);
    if (frame->rows == NULL) {
        frame->points.n = 0;
        return HS_ERR_MEMORY;
    }
    frame->points = (hs_points){.data = frame->rows,
                                .n = points->n,
                                .ndim = points->ndim,
                                .real = points->real,
                                .row_stride = (ptrdiff_t)row_size,
                                .column_stride = (ptrdiff_t)size};
    frame->has_box = box != NULL;
    if (box != NULL) {
        frame->box = *box;
    }
    return take_points(points, options, frame, failure);
}

bool
hs_frames_match(const hs_frame *one, const hs_frame *other)
{
    int       rows[HS_MAX_DIM], others[HS_MAX_DIM];
    const int m = hs_frame_periodic(one, rows);
    return one->points.n == other->points.n && one->points.ndim == other->points.ndim &&
           one->points.real == other->points.real && m == hs_frame_periodic(other, others) &&
           memcmp(rows, others, (size_t)m * sizeof *rows) == 0;
}

bool
hs_frames_share_box(const hs_frame *one, const hs_frame *other)
{
    int       rows[HS_MAX_DIM];
    const int m = hs_frame_periodic(one, rows);
    for (int r = 0; r < m; r++) {
        for (int k = 0; k < one->points.ndim; k++) {
            if (one->box.rows[rows[r]][k] != other->box.rows[rows[r]][k]) {
                return false;
            }
        }
    }
    return true;
}

void
hs_frame_free(hs_frame *frame)
{
    hs_store_free(&frame->store);
    frame->rows = NULL;
}
