/* SPDX-License-Identifier: BSD-3-Clause */
/* test_systems_thread.c: which points and box each system has, and when a thread asks whether to go
 * on. */
#include "../../../csrc/core/api/systems_thread.h"
#include "../support/harness.h"

void test_systems_thread(void);

static const double x[5] = {0.0, 1.0, 2.0, 3.0, 4.0};

static void
systems_are_ranges_of_the_points(void)
{
    const int64_t    first[] = {0, 2, 2, 5};
    const hs_points  points = {x, 5, 1, HS_FLOAT64, 8, 8}, none = {NULL, 0, 1, HS_FLOAT64, 8, 8};
    const hs_systems systems = {3, first, NULL, NULL, NULL, NULL, NULL};
    hs_systems_job   job = {.points = &points, .systems = &systems};
    hs_points        own;
    hs_box           box;
    CHECK(hs_systems_take(&job, 0, &own, &box) == NULL && own.data == x && own.n == 2);
    CHECK(hs_systems_take(&job, 1, &own, &box) == NULL && own.n == 0);
    CHECK(hs_systems_take(&job, 2, &own, &box) == NULL && own.data == x + 2 && own.n == 3);
    CHECK(own.ndim == 1 && own.row_stride == 8);
    job.points = &none; /* no number is added to NULL */
    CHECK(hs_systems_take(&job, 1, &own, &box) == NULL && own.data == NULL && own.n == 0);
}

/* One box for all, or rows for each, of which it says what repeats. */
static void
each_system_has_its_box(void)
{
    const int64_t    first[] = {0, 1, 2};
    const double     rows[] = {1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0}, y[4] = {0.0};
    const hs_points  points = {y, 2, 2, HS_FLOAT64, 16, 8};
    const hs_box     box = {.ndim = 2, .periodic = {true, false}, .rows = {{9.0}, {0.0, 9.0}}};
    const hs_systems one = {2, first, &box, NULL, NULL, NULL, NULL},
                     each = {2, first, &box, rows, NULL, NULL, NULL};
    const hs_systems open = {2, first, NULL, rows, NULL, NULL, NULL};
    hs_systems_job   job = {.points = &points, .systems = &one};
    hs_points        own;
    hs_box           own_box;
    CHECK(hs_systems_take(&job, 1, &own, &own_box) == &box);
    job.systems = &open;
    CHECK(hs_systems_take(&job, 1, &own, &own_box) == NULL);
    job.systems = &each;
    for (int s = 0; s < 2; s++) {
        CHECK(hs_systems_take(&job, s, &own, &own_box) == &own_box && own_box.ndim == 2);
        CHECK(own_box.periodic[0] && !own_box.periodic[1]);
        CHECK(own_box.rows[0][0] == 1.0 + 4 * s && own_box.rows[0][1] == 2.0 + 4 * s);
        CHECK(own_box.rows[1][0] == 3.0 + 4 * s && own_box.rows[1][1] == 4.0 + 4 * s);
    }
}

typedef struct polls {
    int64_t n;
    double  last;
} polls;

static bool
note_poll(void *context, double fraction)
{
    polls *noted = context;
    CHECK(fraction >= noted->last && fraction <= 1.0);
    noted->last = fraction;
    noted->n++;
    return true;
}

/* Systems without a pair take time as well: some thousand of them between two polls. */
static void
small_systems_are_polled_between_now_and_then(void)
{
    enum { N = 10000 };
    static double   many[N];
    static int64_t  first[N + 1], counts[N];
    const hs_points points = {many, N, 1, HS_FLOAT64, 8, 8};
    for (int s = 0; s <= N; s++)
        first[s] = s;
    const hs_systems systems = {N, first, NULL, NULL, NULL, NULL, NULL};
    hs_options       options = hs_options_default();
    polls            noted = {0, 0.0};
    options.cutoff = 1.0;
    options.threads = 1;
    options.poll = note_poll;
    options.poll_context = &noted;
    CHECK(hs_systems_count(&points, &systems, &options, counts, NULL) == HS_OK);
    CHECK(noted.n >= 3 && noted.n <= 12 && noted.last > 0.75);
}

/* What each thread has done is done by the call. */
static void
work_of_all_threads_is_added_up(void)
{
    enum { N = 64, POINTS = 200 };
    static double   many[N * POINTS];
    static int64_t  first[N + 1], counts[N];
    const hs_points points = {many, N * POINTS, 1, HS_FLOAT64, 8, 8};
    harness_random  random = {5};
    hs_counters     one, two;
    for (int s = 0; s <= N; s++)
        first[s] = s * POINTS;
    for (int e = 0; e < N * POINTS; e++)
        many[e] = random_unit(&random);
    const hs_systems systems = {N, first, NULL, NULL, NULL, NULL, NULL};
    hs_options       options = hs_options_default();
    options.cutoff = 0.125;
    options.threads = 1;
    options.counters = &one;
    CHECK(hs_systems_count(&points, &systems, &options, counts, NULL) == HS_OK);
    options.threads = 2;
    options.counters = &two;
    CHECK(hs_systems_count(&points, &systems, &options, counts, NULL) == HS_OK);
    CHECK(one.candidates > N * POINTS && one.candidates == two.candidates &&
          one.pairs == two.pairs);
    CHECK(one.bytes[HS_FOR_POINTS] > 0 && two.bytes[HS_FOR_POINTS] >= one.bytes[HS_FOR_POINTS]);
    CHECK(two.bytes_peak >= one.bytes_peak);
}

void
test_systems_thread(void)
{
    RUN(systems_are_ranges_of_the_points);
    RUN(each_system_has_its_box);
    RUN(small_systems_are_polled_between_now_and_then);
    RUN(work_of_all_threads_is_added_up);
}
