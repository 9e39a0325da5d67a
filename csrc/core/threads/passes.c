/* SPDX-License-Identifier: BSD-3-Clause */
/* passes.c: each round is one job of the team. */
#include "passes.h"

typedef struct pass {
    hs_slab_fn run;
    void      *context;
    int64_t    n;
    int64_t    round, n_rounds;
    int        n_strips; /* 0: slabs */
    hs_status  status[HS_SLABS];
} pass;

static void
do_slab(void *context, int64_t slab)
{
    pass         *doing = context;
    const int64_t first = doing->round * HS_POLL_POINTS + slab * HS_SLAB_POINTS;
    const int64_t left = doing->n - first;
    const int64_t n = left < HS_SLAB_POINTS ? left : HS_SLAB_POINTS;
    doing->status[slab] = doing->run(doing->context, (int)slab, first, first + n);
}

/* Part `round` of n_rounds nearly equal parts of strip `slab`. The products fit: n * n / 2^17 is
 * below 2^63 up to 2^40 pairs, whose i and j take 9 TB. */
static void
do_strip(void *context, int64_t slab)
{
    pass         *doing = context;
    const int64_t begin = doing->n * slab / doing->n_strips;
    const int64_t length = doing->n * (slab + 1) / doing->n_strips - begin;
    const int64_t first = begin + length * doing->round / doing->n_rounds;
    const int64_t last = begin + length * (doing->round + 1) / doing->n_rounds;
    doing->status[slab] = doing->run(doing->context, (int)slab, first, last);
}

static hs_status
walk(hs_team *team, const hs_options *options, pass *doing)
{
    doing->n_rounds = (doing->n + HS_POLL_POINTS - 1) / HS_POLL_POINTS;
    for (doing->round = 0; doing->round < doing->n_rounds; doing->round++) {
        const int64_t left = doing->n - doing->round * HS_POLL_POINTS;
        const int64_t now = left < HS_POLL_POINTS ? left : HS_POLL_POINTS;
        const int64_t n_tasks = doing->n_strips > 0 ? doing->n_strips
                                                    : (now + HS_SLAB_POINTS - 1) / HS_SLAB_POINTS;
        hs_team_run(team, n_tasks, doing->n_strips > 0 ? do_strip : do_slab, doing);
        for (int64_t task = 0; task < n_tasks; task++) {
            if (doing->status[task] != HS_OK) {
                return doing->status[task];
            }
        }
        const hs_status status = now == HS_POLL_POINTS ? hs_poll(options, 0.0) : HS_OK;
        if (status != HS_OK) {
            return status;
        }
    }
    return HS_OK;
}

hs_status
hs_walk_slabs(hs_team *team, const hs_options *options, int64_t n, hs_slab_fn run, void *context)
{
    if (n > 0 && n <= HS_SLAB_POINTS) {
        return run(context, 0, 0, n);
    }
    pass doing = {.run = run, .context = context, .n = n};
    return walk(team, options, &doing);
}

hs_status
hs_walk_strips(hs_team *team, const hs_options *options, int64_t n, int n_strips, hs_slab_fn run,
               void *context)
{
    HS_ASSERT(n_strips >= 1 && n_strips <= HS_SLABS);
    pass doing = {.run = run, .context = context, .n = n, .n_strips = n_strips};
    return walk(team, options, &doing);
}
