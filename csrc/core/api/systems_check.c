/* SPDX-License-Identifier: BSD-3-Clause */
/* systems_check.c: what all systems share is checked also where there are none. */
#include "systems_check.h"

#include "by_reach.h"

#include <math.h>

static hs_status
check_queries(const hs_system_sets *sets, hs_failure *failure)
{
    const hs_systems of_queries = {.n = sets->systems->n, .first = sets->systems->first_query};
    if (sets->queries == NULL) {
        return HS_OK;
    }
    const hs_status status = hs_check_systems(&of_queries, sets->queries->n, failure);
    failure->in_queries = status != HS_OK;
    return status;
}

hs_status
hs_systems_check(const hs_system_sets *sets, const hs_call *total, hs_failure *failure)
{
    const hs_systems *systems = sets->systems;
    const hs_box     *box = systems != NULL ? systems->box : NULL;
    hs_status         status =
        hs_check_arguments(sets->points, sets->queries, box, &total->options, failure);
    if (status == HS_OK) {
        status = hs_check_systems(systems, sets->points->n, failure);
    }
    if (status == HS_OK) {
        status = check_queries(sets, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    return total->kernel == NULL            ? HS_ERR_KERNEL
           : hs_systems_have_boxes(systems) ? HS_OK
                                            : hs_box_check(box, failure);
}

hs_status
hs_systems_check_limit(const hs_system_sets *sets, bool is_full, const hs_options *options,
                       hs_failure *failure)
{
    const hs_systems *systems = sets->systems;
    if (systems->reach != NULL) { /* limits of each system are looked at with it */
        hs_options       without = *options;
        const hs_request request = {
            .sets = {.points = sets->points, .queries = sets->queries, .is_full = is_full},
            .options = &without,
            .reach = systems->reach};
        without.cutoff = systems->cutoffs != NULL ? 0.0 : options->cutoff;
        return hs_by_reach_check(&request, failure);
    }
    if (systems->cutoffs == NULL && !(options->cutoff >= 0.0 && isfinite(options->cutoff))) {
        failure->value = options->cutoff;
        return HS_ERR_CUTOFF;
    }
    return HS_OK;
}

void
hs_share_limit(hs_options *options, int n_threads)
{
    if (n_threads > 1 && options->find_limit != NULL) {
        options->memory_limit =
            fmin(options->memory_limit, options->find_limit(options->find_context));
        options->find_limit = NULL;
    }
    options->memory_limit /= n_threads;
}
