/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_node_changes.c: what the functions that change rows and pairs refuse before they look at
 * these; the tests of kept_rows, kept_pairs and row_pairs have what they do. */
#include "../../../csrc/halfshell_nodes.h"
#include "../support/harness.h"

#include <math.h>

void test_api_node_changes(void);

static const int64_t        ends[2] = {0, 0}, count[1] = {1};
static const int32_t        zero[1] = {0};
static const hs_list_rows   rows = {1, 1, ends, 0, NULL, NULL, 1};
static const hs_node_lists  lists = {.n_lists = 1, .n_nodes = count};
static const hs_node_change change = {1, count, zero, NULL};
static const hs_node_pairs  pairs = {0, NULL, NULL, NULL, NULL, NULL, 1};

static void
what_is_missing_is_refused(void)
{
    const hs_options options = hs_options_default();
    hs_node_lists    negative = lists;
    hs_connectivity *made = (hs_connectivity *)&negative;
    hs_pairs        *kept = (hs_pairs *)&negative;
    negative.n_lists = -1;
    CHECK(hs_connectivity_pair(NULL, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(made == NULL);
    CHECK(hs_connectivity_pair(&rows, NULL, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_pair(&rows, &negative, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_pair(&rows, &lists, NULL, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_pair(&rows, &lists, &options, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_node_pairs_keep(NULL, NULL, NULL, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_node_pairs_keep(&pairs, NULL, NULL, NULL, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_node_pairs_keep(&pairs, NULL, NULL, &options, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_rows_keep(NULL, &change, NULL, 1, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    CHECK(kept == NULL);
    CHECK(hs_rows_keep(&rows, NULL, NULL, 1, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_rows_keep(&rows, &change, NULL, 1, NULL, &kept, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_rows_keep(&rows, &change, NULL, 1, &options, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_rows_without(NULL, &rows, true, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_rows_without(&rows, NULL, true, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_rows_without(&rows, &rows, true, NULL, &kept, NULL) == HS_ERR_ARGUMENT);
}

static void
resources_are_checked(void)
{
    hs_options       options = hs_options_default();
    hs_connectivity *made;
    hs_pairs        *kept;
    options.memory_limit = NAN;
    CHECK(hs_connectivity_pair(&rows, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_node_pairs_keep(&pairs, NULL, NULL, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_rows_keep(&rows, &change, NULL, 1, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_rows_without(&rows, &rows, true, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    hs_failure failure;
    options.memory_limit = 1.0;
    CHECK(hs_rows_keep(&rows, &change, NULL, 1, &options, &kept, &failure) == HS_ERR_MEMORY);
    CHECK(failure.limit_bytes == 1.0 && kept == NULL);
    CHECK(hs_connectivity_pair(&rows, &lists, &options, &made, &failure) == HS_ERR_MEMORY);
    CHECK(failure.limit_bytes == 1.0 && made == NULL);
}

static void
nothing_stays_nothing(void)
{
    const hs_options options = hs_options_default();
    hs_connectivity *made;
    hs_pairs        *kept;
    CHECK(hs_connectivity_pair(&rows, &lists, &options, &made, NULL) == HS_OK);
    CHECK(hs_pairs_length(hs_connectivity_pairs(made)) == 0);
    CHECK(hs_pairs_array(hs_connectivity_pairs(made), HS_WANT_J) != NULL);
    hs_connectivity_free(made);
    CHECK(hs_rows_keep(&rows, &change, NULL, 0, &options, &kept, NULL) == HS_OK);
    CHECK(hs_pairs_rows(kept) == 0 && hs_pairs_offsets(kept)[0] == 0);
    hs_pairs_free(kept);
}

void
test_api_node_changes(void)
{
    RUN(what_is_missing_is_refused);
    RUN(resources_are_checked);
    RUN(nothing_stays_nothing);
}
