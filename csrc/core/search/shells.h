/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * shells.h: several cutoffs of one search, and for each but the last the float64 distances that do
 * not tell on which side of it a pair is. The last one is that of the search itself. A table,
 * indexed by the leading bits of a distance, knows for each of its cells which edges are in it.
 */
#ifndef HS_SHELLS_H
#define HS_SHELLS_H

#include "../scene/scene.h"

/* Distances of one cell of the table: `below` edges are below them; above `high`, one more. From
 * `low` to `high` they do not tell. These two are the bits of doubles, which order like them. */
typedef struct hs_shell_cell {
    int64_t low, high;
    int32_t below;
} hs_shell_cell;

/* Shared by all threads. Arrays have n entries and do not descend. */
typedef struct hs_shells {
    int64_t        n;         /* edges: cutoffs but the last; 0 also where shells are not wanted */
    bool           inclusive; /* an edge belongs to the shell below it */
    double        *edge;      /* owned; in the caller's unit */
    double        *at; /* in the memory of `edge`, like those below; as the scene's metric has it */
    double        *low;   /* a distance below this, as it is returned, is below the edge, ... */
    double        *high;  /* ... and one above this is above it */
    hs_shell_cell *cells; /* owned; last + 1 */
    int            shift; /* bits of a distance that do not choose the cell */
    int64_t        first; /* leading bits of the distances of cell 0; lower ones are there too */
    int64_t        last;  /* number of the last cell; that of the largest cutoff */
} hs_shells;

/* Those of the options, if they are wanted; HS_OK or HS_ERR_MEMORY. */
hs_status hs_shells_open(hs_account *account, const hs_scene *scene, const hs_options *options,
                         hs_shells *shells);

/* Harmless twice. */
void hs_shells_free(hs_account *account, hs_shells *shells);

/* How many edges each of n distances, which are not negative, is surely above; for one that its
 * cell does not tell at least so many are. Returns whether there is such a one. */
bool hs_shells_find(const hs_shells *shells, const double *distance, int32_t n, int32_t *shell);

/* For a distance that is above *low edges or more: *low that it is surely above, and *high that it
 * may be. */
void hs_shells_range(const hs_shells *shells, double distance, int32_t *low, int32_t *high);

/* A distance as it is returned, of a pair that was decided to be in shell k: on the right side of
 * both edges, and still within 1 ulp, because the true distance is there too. */
double hs_shells_keep(const hs_shells *shells, int64_t k, double distance);

#endif
