/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_snapshot.c: the copy of one step's points: every type and layout, the first number that is
 * not finite, and which frames a list can go from to which.
 */
#include "../../../csrc/core/scene/snapshot.h"
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/base/poll.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include <float.h>
#include <math.h>

void test_snapshot(void);

static hs_status
take(const hs_points *points, hs_frame *frame, hs_failure *failure)
{
    const hs_options options = hs_options_default();
    *failure = HS_NO_FAILURE;
    return hs_frame_take(points, NULL, &options, frame, failure);
}

/* Row-major with gaps, column-major, reversed, one row for all: the copy has no gaps. */
static void
any_layout_is_copied(void)
{
    enum { N = 37, D = 3 };
    static float  f[2 * N * D + 8];
    static double x[2 * N * D + 8];
    for (int e = 0; e < 2 * N * D + 8; e++) {
        f[e] = (float)(e * 0.5 - 20.0);
        x[e] = -e * 0.1;
    }
    const struct {
        ptrdiff_t row, column; /* in entries */
        int64_t   first;
        int       ndim;
    } layouts[] = {{D, 1, 0, D},     {2 * D, 1, 0, D}, {1, N, 0, D}, {-D, 1, (N - 1) * D, D},
                   {0, 1, 5, D},     {2 * D, 2, 0, D}, {1, 7, 0, 1}, {2, 7, 0, 1},
                   {D, -1, D - 1, D}};
    hs_frame frame = {0};
    for (int l = 0; l < 18; l++) {
        const bool    narrow = l >= 9;
        const int     d = layouts[l % 9].ndim;
        const int64_t size = narrow ? sizeof(float) : sizeof(double), first = layouts[l % 9].first;
        double        largest = 0.0;
        hs_failure    failure;
        hs_points     points = {.n = N, .ndim = d, .real = narrow ? HS_FLOAT32 : HS_FLOAT64};
        points.data = narrow ? (const void *)(f + first) : (const void *)(x + first);
        points.row_stride = layouts[l % 9].row * size;
        points.column_stride = layouts[l % 9].column * size;
        CHECK(take(&points, &frame, &failure) == HS_OK);
        CHECK(frame.points.row_stride == d * size && frame.points.column_stride == size);
        for (int64_t i = 0; i < N; i++) {
            for (int k = 0; k < d; k++) {
                const int64_t from = first + i * layouts[l % 9].row + k * layouts[l % 9].column;
                const double  expected = narrow ? f[from] : x[from];
                CHECK(hs_frame_entry(frame.rows, points.real, i * d + k) == expected);
                largest = fmax(largest, fabs(expected));
            }
        }
        CHECK(frame.largest == largest);
    }
    hs_frame_free(&frame);
    hs_frame_free(&frame);
}

static void
the_first_that_is_not_finite_is_named(void)
{
    enum { N = 50 };
    float        f[2 * N];
    double       x[2 * N];
    const double bad[] = {NAN, INFINITY, -INFINITY};
    hs_frame     frame = {0};
    hs_failure   failure;
    for (int trial = 0; trial < 4 * N; trial++) {
        const int at = trial / 2;
        for (int e = 0; e < 2 * N; e++) {
            f[e] = (float)e;
            x[e] = e % 2 ? DBL_MAX : -DBL_MAX; /* sums of these would not be finite */
        }
        f[at] = (float)bad[at % 3];
        x[at] = bad[at % 3];
        if (trial % 2) /* alone, or not the only one */
            f[2 * N - 1] = (float)(x[2 * N - 1] = NAN);
        const hs_points narrow = {f, N, 2, HS_FLOAT32, 8, 4}, wide = {x, N, 2, HS_FLOAT64, 16, 8};
        for (int w = 0; w < 2; w++) {
            CHECK(take(w ? &wide : &narrow, &frame, &failure) == HS_ERR_NOT_FINITE);
            CHECK(failure.row == at / 2 && failure.column == at % 2);
            CHECK(!isfinite(failure.value));
        }
    }
    for (int e = 0; e < 2 * N; e++)
        x[e] = e % 2 ? DBL_MAX : -DBL_MAX;
    const hs_points all = {x, N, 2, HS_FLOAT64, 16, 8};
    CHECK(take(&all, &frame, &failure) == HS_OK && frame.largest == DBL_MAX);
    hs_frame_free(&frame);
}

/* One number for all points takes no memory to give, and some to copy. */
static void
large_frames_can_be_stopped(void)
{
    const int64_t   n = 2 * HS_POLL_POINTS + 5;
    const float     x = -2.5f;
    const hs_points points = {&x, n, 1, HS_FLOAT32, 0, 0};
    hs_options      options = hs_options_default();
    hs_frame        frame = {0};
    hs_failure      failure = HS_NO_FAILURE;
    int64_t         polls = 0;
    options.poll = stop_after;
    options.poll_context = &polls;
    CHECK(hs_frame_take(&points, NULL, &options, &frame, &failure) == HS_ERR_INTERRUPTED);
    polls = 1;
    CHECK(hs_frame_take(&points, NULL, &options, &frame, &failure) == HS_ERR_INTERRUPTED);
    polls = 2;
    CHECK(hs_frame_take(&points, NULL, &options, &frame, &failure) == HS_OK && polls == 0);
    CHECK(frame.largest == 2.5 && hs_frame_entry(frame.rows, HS_FLOAT32, n - 1) == -2.5);
    hs_frame_free(&frame);
}

/* As many, of one type and dimension, in boxes that repeat along the same axes. */
static void
frames_match_or_do_not(void)
{
    const double     x[12] = {0.0};
    const hs_options options = hs_options_default();
    hs_box           box = {.ndim = 2, .periodic = {true, false}, .rows = {{1, 0}, {0, 1}}};
    const hs_box     longer = {.ndim = 2, .periodic = {true, false}, .rows = {{1, 0.5}, {0, 7}}};
    const hs_box     wide = {.ndim = 2, .periodic = {true, false}, .rows = {{1, 0}, {9, 9}}};
    const hs_box     other = {.ndim = 2, .periodic = {false, true}, .rows = {{1, 0}, {0, 1}}};
    const hs_box     both = {.ndim = 2, .periodic = {true, true}, .rows = {{1, 0}, {0, 1}}};
    const hs_points  one = {x, 5, 2, HS_FLOAT64, 16, 8}, fewer = {x, 4, 2, HS_FLOAT64, 16, 8};
    const hs_points  narrow = {x, 5, 2, HS_FLOAT32, 8, 4}, flat = {x, 5, 1, HS_FLOAT64, 8, 8};
    const struct {
        const hs_points *points;
        const hs_box    *box;
        bool             matches;
    } cases[] = {{&one, &box, true},    {&one, &longer, true}, {&one, &wide, true},
                 {&fewer, &box, false}, {&flat, NULL, false},  {&narrow, &box, false},
                 {&one, &both, false},  {&one, &other, false}, {&one, NULL, false}};
    hs_frame   base = {0}, frame = {0};
    hs_failure failure = HS_NO_FAILURE;
    CHECK(hs_frame_take(&one, &box, &options, &base, &failure) == HS_OK);
    for (int c = 0; c < 9; c++) {
        CHECK(hs_frame_take(cases[c].points, cases[c].box, &options, &frame, &failure) == HS_OK);
        CHECK(hs_frames_match(&base, &frame) == cases[c].matches);
        CHECK(hs_frames_match(&frame, &base) == cases[c].matches);
        if (cases[c].matches)
            CHECK(hs_frames_share_box(&base, &frame) == (c != 1));
    }
    hs_frame_free(&base);
    hs_frame_free(&frame);
}

void
test_snapshot(void)
{
    RUN(any_layout_is_copied);
    RUN(the_first_that_is_not_finite_is_named);
    RUN(large_frames_can_be_stopped);
    RUN(frames_match_or_do_not);
}
