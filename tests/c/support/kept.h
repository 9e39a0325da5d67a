/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * kept.h: hashes of what the core has always said, in golden/kept.txt: of answers, and of what may
 * change on purpose: the order of what is not sorted, plans, and the work that counters tell.
 * `make kept` writes the file anew, for git to show what is another one.
 */
#ifndef HS_KEPT_H
#define HS_KEPT_H

#include "../../../csrc/halfshell.h"
#include "harness.h"

/* Bytes, and what one kernel leaves to the next stage, are those of this system. */
#if defined(__x86_64__) && defined(__linux__)
#define WORK_IS_KEPT 1
#else
#define WORK_IS_KEPT 0
#endif

static const struct kept_hash {
    const char *name;
    uint64_t    answers, work;
} kept_hashes[] = {
#include "../golden/kept.txt"
};

static inline uint64_t
hash_bytes(uint64_t hash, const void *bytes, size_t n)
{
    for (size_t b = 0; b < n; b++)
        hash = (hash ^ ((const unsigned char *)bytes)[b]) * UINT64_C(1099511628211);
    return hash;
}

/* What depends on no number of threads. */
static inline uint64_t
hash_counters(uint64_t hash, const hs_counters *counters)
{
    const int64_t counts[] = {counters->groups,     counters->candidates, counters->pairs,
                              counters->ambiguous,  counters->by_float64, counters->by_double_word,
                              counters->by_integers};
    return hash_bytes(hash, counts, sizeof counts);
}

static inline uint64_t
hash_plan(uint64_t hash, const hs_plan *plan)
{
    const size_t  d = (size_t)plan->ndim;
    const int64_t numbers[] = {
        plan->n_periodic, plan->aligned,    plan->reduced, plan->keeps_originals, plan->algorithm,
        plan->all_pairs,  plan->n_searches, plan->n_cells, plan->stencil_rows,    plan->sparse};
    hash = hash_bytes(hash, numbers, sizeof numbers);
    hash = hash_bytes(hash, plan->shape, d * sizeof *plan->shape);
    hash = hash_bytes(hash, plan->cell_size, d * sizeof *plan->cell_size);
    hash = hash_bytes(hash, plan->reach, d * sizeof *plan->reach);
    hash = hash_bytes(hash, plan->images, d * sizeof *plan->images);
    return hash_bytes(hash, &plan->expected_pairs, sizeof plan->expected_pairs);
}

static inline void
check_kept(const char *name, uint64_t answers, uint64_t work)
{
    const size_t n = sizeof kept_hashes / sizeof kept_hashes[0];
    const char  *path = getenv("HALFSHELL_KEPT");
    size_t       k = 0;
    while (k < n && strcmp(kept_hashes[k].name, name) != 0)
        k++;
    const bool answers_are = k < n && kept_hashes[k].answers == answers;
    const bool work_is = !WORK_IS_KEPT || (k < n && kept_hashes[k].work == work);
    CHECK(answers_are);
    CHECK(work_is);
    if (!answers_are || !work_is)
        fprintf(stderr, "  %s\n", name);
    if (path != NULL) {
        FILE *file = fopen(path, "a");
        fprintf(file, "{\"%s\", UINT64_C(0x%016llx), UINT64_C(0x%016llx)},\n", name,
                (unsigned long long)answers, (unsigned long long)work);
        fclose(file);
    }
}

#endif
