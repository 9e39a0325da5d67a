/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_API_QUERY_H
#define HS_API_QUERY_H

#include "../collect/parallel.h"
#include "../levels/levels.h"
#include "../nearest/nearest.h"
#include "../search/choice.h"

/*
 * query.h: a query, checked once, and its way from there to what the caller gets. It is a plan of
 * steps, each of them one open search: one step where one cutoff holds for all pairs, several where
 * pairs have a reach of their own, and all of these for each of several systems.
 */

/*
 * Checks of what a program of C may get wrong about the arguments of halfshell.h, so that no memory
 * is read or written out of bounds. The binding checks Python's arguments before. Coordinates,
 * boxes and cutoffs are checked when the scene is made (scene.h). Any pointer may be NULL, except
 * the options and the failure that are given to a function hs_check_*.
 */

/* Ends such a call, with counters of nothing: returns the status. *failure, unless NULL, has no
 * details. */
hs_status hs_end_early(hs_status status, const hs_options *options, hs_failure *failure);

/* Whether an array is there that has one entry for each of these points, if there are any. */
bool hs_has_entries(const void *array, const hs_points *points);

/* HS_OK or HS_ERR_ARGUMENT. The box may be NULL; ndim is that of the points. */
hs_status hs_check_box(const hs_box *box, int ndim);

/* Checks the options that every function uses: threads and the memory limit. */
hs_status hs_check_resources(const hs_options *options);

/* `known`: the HS_WANT_ bits that there may be. */
hs_status hs_check_options(const hs_options *options, unsigned known);

/* Of a cutoff, a radius, an edge: finite and not negative. */
HS_ALWAYS_INLINE bool
hs_is_length(double x)
{
    return x >= 0.0 && isfinite(x);
}

/* Points, queries and box; failure->in_queries tells queries from points. */
hs_status hs_check_sets(const hs_points *points, const hs_points *queries, const hs_box *box,
                        hs_failure *failure);

/* Cells that are kept between calls. */
struct hs_cells {
    hs_call   call;   /* that built them; its account holds them */
    hs_search search; /* open, never walked itself: calls borrow from it */
    hs_points points; /* of `copy` */
    hs_box    box;
    bool      has_box;
    double   *copy; /* owned; points as given, for cutoffs and queries that need other cells */
    hs_nearest_kept *trees; /* owned; a search for the nearest needs a tree, not cells */
};

/* Lengths that distances are sorted by are fewer: twice as many are int32. */
#define HS_MOST_LENGTHS (INT64_C(1) << 30)

/* What to search for. All is borrowed but for the options: a copy, in which each function sets what
 * it does not leave to the caller. */
typedef struct hs_query {
    hs_sets             sets;
    const hs_box       *box;
    hs_options          options;
    const hs_reach     *reach;     /* NULL: the cutoff holds for all pairs */
    const hs_selection *selection; /* NULL: all pairs within reach count */
    const hs_among     *among; /* several systems, whose points are all above; NULL: one system */
    bool is_incomplete;        /* an argument is missing without which the call cannot begin */
    /* Distances are sorted by the shells, which are the edges of a histogram; cutoffs of systems do
     * not count. */
    bool is_by_length;
} hs_query;

/* Which pairs a search is for: each once, among the points alone; every neighbour of each point or
 * query; or the first without queries and the second with them. */
typedef enum hs_list_kind { HS_HALF_LIST, HS_FULL_LIST, HS_HALF_OR_QUERIES } hs_list_kind;

/* `among` may be NULL or contradict itself: then no points are set, which is refused later. Without
 * options the query is incomplete. */
hs_query hs_query_among(const hs_among *among, hs_list_kind kind, const hs_options *options);

/* How many points or queries ask. */
HS_ALWAYS_INLINE int64_t
hs_query_asking(const hs_query *query)
{
    const hs_sets *sets = &query->sets;
    return sets->queries != NULL ? sets->queries->n : sets->points != NULL ? sets->points->n : 0;
}

typedef struct hs_query_run hs_query_run;

/* Makes use of a run: of all its steps, or of one that is open. */
typedef hs_status (*hs_use_fn)(void *context, hs_query_run *run);

/* What a search is for: how the pairs of one system are found, and what is done with them. */
typedef struct hs_finder {
    hs_use_fn find; /* of all steps of a system; NULL: each is used by `step` */
    hs_use_fn step;
    void     *context;     /* borrowed; threads share it */
    bool      has_result;  /* pairs are returned */
    bool      has_rows;    /* offsets come with them */
    bool      is_numbered; /* finds numbers among all systems: else they are added afterwards */
    bool      is_nearest;  /* the cutoff may be infinite, and there is no reach */
    bool      one_thread;  /* several systems are searched by the caller's thread */
} hs_finder;

/*
 * A query at work, of one system; a thread that searches several has one run for all of them. It
 * must not move while a step is open.
 */
struct hs_query_run {
    hs_call         *call; /* borrowed, as are all up to the keeper */
    const hs_query  *query;
    const hs_finder *finder;
    hs_failure      *failure;
    hs_output       *output;      /* pairs go behind those that it has; NULL: only counting */
    hs_output       *offsets;     /* of rows */
    hs_keeper       *keeper;      /* of a thread that searches several systems; else NULL */
    bool             is_part;     /* one of several systems, which share a choice */
    bool             is_numbered; /* the search itself takes numbers among all of them: */
    int64_t          system, first_point, first_asking; /* its number, and what lies before it */
    int64_t          n_in_all;   /* points or queries that ask, of all systems */
    int64_t          n_pairs;    /* that were counted, of all of them */
    bool             has_scene;  /* the step was open for another system before */
    bool             has_levels; /* pairs have a reach; else the plan is of one step */
    hs_levels        levels;
    hs_level_plan    plan;
    hs_search       *search; /* of the step that is open, or NULL */
    hs_level_search  step;   /* large, and filled before it is read */
};

/*
 * A call of a public function: checks the query, plans and finds. failure: NULL, or what was wrong.
 * *result becomes the pairs, if there are to be any, to be freed by hs_pairs_free; NULL on failure.
 */
hs_status hs_query_answer(const hs_query *query, const hs_finder *finder, hs_pairs **result,
                          hs_failure *failure);

/* Its parts. A run without a step, for a call that has begun. */
void hs_query_begin(const hs_query *query, const hs_finder *finder, hs_call *call,
                    hs_failure *failure, hs_query_run *run);

/* Begins it, checks the query, chooses pairs, and of one system plans the steps; on failure the run
 * is closed. */
hs_status hs_query_open(const hs_query *query, const hs_finder *finder, hs_call *call,
                        hs_query_run *run, hs_failure *failure);

/* Plans the steps of one system, whose query has been checked. */
hs_status hs_query_plan(hs_query_run *run);

/* Idempotent. */
void hs_query_close(hs_query_run *run);

/* Opens a step of the plan; closes it. */
hs_status hs_query_open_step(hs_query_run *run, int64_t number);
void      hs_query_close_step(hs_query_run *run);

/* What the finder finds in one system. */
hs_status hs_query_find(hs_query_run *run);

/* Uses each step in turn, as long as that gives HS_OK. */
hs_status hs_query_each_step(hs_query_run *run, hs_use_fn use, void *context);

/* Counts the row of a failure, if it is that of a point, among those of all systems. */
void hs_query_name_point(const hs_query_run *run, hs_status status);

/* One of several systems, cut from all; it must not move. */
typedef struct hs_system {
    hs_query  query; /* with its own cutoff */
    hs_set    points, queries;
    hs_box    own_box;
    hs_choice choice; /* as all have it, in its box */
} hs_system;

/* Several systems (systems.c): checks what they share; finds in each of them, by the threads of the
 * call; adds up what they would have taken. */
hs_status hs_systems_check(const hs_query *query, hs_failure *failure);
hs_status hs_systems_find(hs_query_run *run);
void      hs_systems_add_shortage(const hs_query *query, hs_shortage *shortage);

/* What all cuts of a query have, and a run of such a cut. */
void hs_system_begin(const hs_query *all, const hs_finder *finder, hs_call *call,
                     hs_failure *failure, hs_system *system, hs_query_run *run);

/* System s of all: cuts it, in place of another, and plans its steps; to be closed in any case.
 * `choice` is that of all, or NULL. On failure that names it. */
hs_status hs_system_open(const hs_query *all, int64_t s, const hs_choice *choice, hs_system *system,
                         hs_query_run *run);

/* A call that makes a result, if it has its input, options and a place for it. *result becomes
 * NULL, *failure where the failure goes, and the call is entered: hs_result_end must follow. NULL
 * where it has ended, with *status. */
hs_pairs *hs_result_begin(bool has_input, const hs_options *options, hs_pairs **result,
                          hs_failure **failure, hs_status *status);

/* Leaves the call, if there is one. *result becomes what was made, or that is freed. Returns the
 * status. */
hs_status hs_result_end(hs_pairs *made, hs_status status, hs_pairs **result, hs_failure *failure);

/* Takes out of the options what is about columns, for a search that gives none. */
void hs_query_want_none(hs_query *query);

#endif
