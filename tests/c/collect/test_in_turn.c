/* SPDX-License-Identifier: BSD-3-Clause */
/* test_in_turn.c: whoever collects them and whenever, pairs are in the output in the order of their
 * ranges; of several failures the earliest range's is told. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#endif
#include "../../../csrc/core/collect/in_turn.h"
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/base/poll.h"
#include "../../../csrc/core/threads/team.h"
#include "../../../csrc/core/base/os_thread.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"

void test_in_turn(void);

enum { RANGES = 200 };

/* A thread that commits pairs, numbered from 1000 times the range on. */
typedef struct collector {
    hs_committer committer;
    hs_output    pairs;
    hs_options   options;
} collector;

static void
open_collector(hs_commits *commits, collector *me)
{
    me->options = hs_options_default();
    hs_output_init(NULL, 3, HS_WANT_J, 4, &me->pairs);
    me->committer = (hs_committer){.options = &me->options, .pairs = &me->pairs};
    hs_commits_join(commits, &me->committer);
}

/* Pairs [first, end) of a range. */
static hs_status
collect(collector *me, int64_t range, int first, int end, bool ends)
{
    const hs_status status = hs_output_reserve(&me->pairs, end - first, 0.0);
    int32_t        *to = hs_output_next(&me->pairs, HS_WANT_J);
    for (int e = first; e < end; e++) {
        to[e - first] = (int32_t)(1000 * range + e);
    }
    me->pairs.n_pairs += end - first;
    return status == HS_OK ? hs_commit(&me->committer, (double)range / RANGES, ends) : status;
}

static int
pairs_of(int64_t range)
{
    return (int)(range * 37 % 400);
}

/* In two parts, as a hs_range_fn. */
static hs_status
collect_range(void *worker, int64_t range)
{
    collector      *me = worker;
    const int       half = pairs_of(range) / 2;
    const hs_status status = collect(me, range, 0, half, false);
    return status == HS_OK ? collect(me, range, half, pairs_of(range), true) : status;
}

static bool
is_in_order(const hs_output *output, int64_t n_ranges)
{
    const int32_t *j = hs_output_column(output, HS_WANT_J);
    int64_t        at = 0;
    bool           right = true;
    for (int64_t range = 0; range < n_ranges; range++) {
        for (int e = 0; e < pairs_of(range); e++, at++) {
            right = right && at < output->n_pairs && j[at] == 1000 * range + e;
        }
    }
    return right && at == output->n_pairs;
}

typedef struct crew {
    hs_commits *commits;
    hs_range_fn search_range;
    collector   of[8];
} crew;

static void
work(void *context, int64_t task)
{
    crew      *all = context;
    collector *me = &all->of[task];
    open_collector(all->commits, me);
    hs_commits_work(&me->committer, all->search_range, me);
    hs_output_free(&me->pairs);
}

static void
ranges_come_in_order(void)
{
    for (int threads = 1; threads <= 8; threads++) {
        static crew all;
        hs_output   output;
        hs_failure  failure;
        hs_team    *team = hs_team_create(threads);
        hs_output_init(NULL, 3, HS_WANT_J, 4, &output);
        all.commits = hs_commits_new(NULL, &output, RANGES);
        all.search_range = collect_range;
        hs_team_run(team, threads, work, &all);
        CHECK(hs_commits_written(all.commits) == RANGES);
        CHECK(hs_commits_end(NULL, all.commits, &failure) == HS_OK);
        CHECK(is_in_order(&output, RANGES));
        hs_output_free(&output);
        hs_team_free(team);
    }
}

/* One thread with two collectors: the second works on later ranges while the first has one open. */
typedef struct nested {
    collector first, second;
    int       n_polls;
    int       pairs_a_range;
} nested;

/* While the second waits, the first ends its range. */
static bool
end_first_range(void *context, double fraction)
{
    nested *both = context;
    (void)fraction;
    if (both->n_polls++ == 0) {
        CHECK(collect(&both->first, 0, 0, both->pairs_a_range, true) == HS_OK);
    }
    return true;
}

/* What cannot be written yet is held back until it is much, in parts or in bytes. */
static void
much_that_is_held_back_waits(void)
{
    static const int pairs[] = {1, 10, HS_COMMIT_BYTES / 4 / 3, HS_COMMIT_BYTES / 4};
    for (int p = 0; p < 4; p++) {
        static nested both;
        hs_output     output;
        hs_failure    failure;
        hs_commits   *commits;
        bool          right = true;
        hs_output_init(NULL, 3, HS_WANT_J, 4, &output);
        commits = hs_commits_new(NULL, &output, 100);
        both.n_polls = 0;
        both.pairs_a_range = pairs[p];
        open_collector(commits, &both.first);
        open_collector(commits, &both.second);
        both.second.options.poll = end_first_range;
        both.second.options.poll_context = &both;
        both.first.committer.range = 0;
        for (int64_t range = 1; range < 100; range++) {
            both.second.committer.range = range;
            CHECK(collect(&both.second, range, 0, pairs[p], true) == HS_OK);
        }
        CHECK(both.n_polls > 0 && hs_commits_written(commits) == 100);
        CHECK(hs_commits_end(NULL, commits, &failure) == HS_OK);
        CHECK(output.n_pairs == 100 * (int64_t)pairs[p]);
        const int32_t *j = hs_output_column(&output, HS_WANT_J);
        for (int64_t at = 0; at < output.n_pairs; at++) {
            right = right && j[at] == 1000 * (at / pairs[p]) + at % pairs[p];
        }
        CHECK(right);
        hs_output_free(&both.first.pairs);
        hs_output_free(&both.second.pairs);
        hs_output_free(&output);
    }
}

/* Parts behind a range that another thread works on stay, in order, when those before it go. */
static void
parts_behind_a_gap_stay(void)
{
    enum { GAP = 3, END = 8 };
    static collector first, gap, all;
    hs_output        output;
    hs_failure       failure;
    hs_output_init(NULL, 3, HS_WANT_J, 4, &output);
    hs_commits *commits = hs_commits_new(NULL, &output, END);
    open_collector(commits, &first);
    open_collector(commits, &gap);
    open_collector(commits, &all);
    for (int64_t range = 1; range < END - 1; range++) {
        if (range == END - 2) {
            CHECK(all.committer.n_parts == END - 4);
            first.committer.range = 0;
            CHECK(collect(&first, 0, 0, pairs_of(0), true) == HS_OK);
        }
        if (range != GAP) {
            all.committer.range = range;
            CHECK(collect(&all, range, 0, pairs_of(range), true) == HS_OK);
        }
    }
    CHECK(hs_commits_written(commits) == GAP && all.committer.n_parts == END - 2 - GAP);
    for (int p = 0; p < all.committer.n_parts; p++) {
        CHECK(all.committer.parts[p].range == GAP + 1 + p);
    }
    gap.committer.range = GAP;
    CHECK(collect(&gap, GAP, 0, pairs_of(GAP), true) == HS_OK);
    CHECK(gap.committer.n_parts == 0 && hs_commits_written(commits) == GAP + 1);
    all.committer.range = END - 1;
    CHECK(collect(&all, END - 1, 0, pairs_of(END - 1), true) == HS_OK);
    CHECK(all.committer.n_parts == 0 && is_in_order(&output, END));
    CHECK(hs_commits_end(NULL, commits, &failure) == HS_OK);
    hs_output_free(&first.pairs);
    hs_output_free(&gap.pairs);
    hs_output_free(&all.pairs);
    hs_output_free(&output);
}

/* Exactly enough pairs are enough: no range is begun then. */
static void
enough_is_a_number_of_pairs(void)
{
    enum { LAST = 5 };
    for (int more = 0; more < 2; more++) {
        static collector one;
        hs_output        output;
        hs_failure       failure;
        int64_t          n = more;
        for (int64_t range = 0; range <= LAST; range++) {
            n += pairs_of(range);
        }
        hs_output_init(NULL, 3, HS_WANT_J, 4, &output);
        hs_commits *commits = hs_commits_new(NULL, &output, RANGES);
        hs_commits_limit(commits, n, INT64_MAX);
        open_collector(commits, &one);
        hs_commits_work(&one.committer, collect_range, &one);
        CHECK(hs_commits_written(commits) == LAST + 1 + more);
        CHECK(is_in_order(&output, LAST + 1 + more));
        CHECK(hs_commits_end(NULL, commits, &failure) == HS_OK);
        hs_output_free(&one.pairs);
        hs_output_free(&output);
    }
}

/* Range 1 is begun before range 0 fails, and goes on until it hears of that. */
static hs_mutex  mutex;
static bool      later_is_begun;
static hs_status later_status;

static bool
has_begun(bool begin)
{
    hs_mutex_lock(&mutex);
    later_is_begun = later_is_begun || begin;
    const bool begun = later_is_begun;
    hs_mutex_unlock(&mutex);
    return begun;
}

static hs_status
fail_in_turn(void *worker, int64_t range)
{
    collector *me = worker;
    me->committer.failure.row = range;
    if (range == 0) {
        while (!has_begun(false)) {
        }
        return HS_ERR_TOO_MANY;
    }
    (void)has_begun(true);
    while (me->options.poll != NULL && hs_poll(&me->options, 0.0) == HS_OK) {
    }
    return me->options.poll != NULL ? later_status : HS_ERR_MEMORY; /* the caller's hears nothing */
}

/* The thread that does not poll hears of the failure: what it makes of it is not told. */
static void
the_earliest_failure_is_told(void)
{
    static const hs_status later[] = {HS_ERR_INTERRUPTED, HS_STOPPED, HS_ERR_MEMORY};
    for (int trial = 0; trial < 12; trial++) {
        static crew all;
        hs_failure  failure = HS_NO_FAILURE;
        hs_team    *team = hs_team_create(2);
        later_is_begun = hs_team_size(team) < 2;
        later_status = later[trial % 3];
        hs_mutex_init(&mutex);
        all.commits = hs_commits_new(NULL, NULL, 2);
        all.search_range = fail_in_turn;
        hs_team_run(team, 2, work, &all);
        CHECK(hs_commits_end(NULL, all.commits, &failure) == HS_ERR_TOO_MANY);
        CHECK(failure.row == 0);
        hs_mutex_destroy(&mutex);
        hs_team_free(team);
    }
}

/* Both ranges are begun before one ends: the caller's thread then has none left, while the other
 * goes on until it hears of a failure. */
static int n_begun;

static hs_status
end_or_go_on(void *worker, int64_t range)
{
    collector *me = worker;
    bool       both = false;
    (void)range;
    for (int begins = 1; !both; begins = 0) {
        hs_mutex_lock(&mutex);
        n_begun += begins;
        both = n_begun >= 2;
        hs_mutex_unlock(&mutex);
    }
    hs_status status = HS_OK;
    while (status == HS_OK && me->options.poll_context != &me->committer) {
        status = hs_poll(&me->options, 0.0);
    }
    return status;
}

static bool
refuse(void *context, double fraction)
{
    (void)context;
    (void)fraction;
    return false;
}

static void
work_refused(void *context, int64_t task)
{
    crew      *all = context;
    collector *me = &all->of[task];
    me->options = hs_options_default();
    me->options.poll = refuse;
    me->committer = (hs_committer){.options = &me->options};
    hs_commits_join(all->commits, &me->committer);
    hs_commits_work(&me->committer, end_or_go_on, me);
}

/* The caller may stop the others while its thread waits for them. */
static void
waiting_for_others_may_be_stopped(void)
{
    static crew all;
    hs_failure  failure = HS_NO_FAILURE;
    hs_team    *team = hs_team_create(2);
    const bool  alone = hs_team_size(team) < 2;
    n_begun = alone;
    hs_mutex_init(&mutex);
    all.commits = hs_commits_new(NULL, NULL, 2);
    hs_team_run(team, 2, work_refused, &all);
    CHECK(hs_commits_end(NULL, all.commits, &failure) == (alone ? HS_OK : HS_ERR_INTERRUPTED));
    hs_mutex_destroy(&mutex);
    hs_team_free(team);
}

void
test_in_turn(void)
{
    RUN(ranges_come_in_order);
    RUN(much_that_is_held_back_waits);
    RUN(parts_behind_a_gap_stay);
    RUN(enough_is_a_number_of_pairs);
    RUN(the_earliest_failure_is_told);
    RUN(waiting_for_others_may_be_stopped);
}
