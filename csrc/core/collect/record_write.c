/* SPDX-License-Identifier: BSD-3-Clause */
/* record_write.c: most scenes have few turns and ordinary numbers, in 2-D or 3-D. Their pairs are
 * shifted and measured while they are written, without the arrays of a batch in between: the time
 * goes into passes over these, not into arithmetic. */
#include "record_write.h"

#include "measures.h"

#include <string.h>

/* Whether hits of this search can be written so, to these columns. */
static bool
can_write(const hs_recorder *recorder, const hs_scanner *scanner)
{
    const hs_search *search = scanner->search;
    const int        d = search->scene.ndim;
    return search->call->kernel->write != NULL &&
           (search->is_half || !(recorder->columns & (HS_WANT_I | HS_WANT_J))) && d >= 2 &&
           d <= HS_WRITE_MOST_DIM && !(recorder->columns & HS_WANT_BOTH) &&
           scanner->trace.of.is_narrow &&
           (!(recorder->columns & HS_MEASURED) ||
            (search->limits == NULL && !search->scene.extreme &&
             search->scene.metric.floats_usable));
}

/* What candidates and points are, of the hits of points from `first` on. */
static void
describe(const hs_scanner *scanner, bool is_measured, int32_t first, hs_write *write)
{
    const hs_search  *search = scanner->search;
    const hs_trace   *trace = &scanner->trace;
    const hs_bins    *asking = hs_search_asking(search);
    const hs_lattice *lattice = &search->scene.lattice;
    const bool        turned = asking->turns.known;
    write->by_S = search->bins.keeps_originals;
    write->is_shifted = trace->of.has_images || write->by_S;
    write->q = is_measured ? trace->of.q : NULL;
    write->number = scanner->block.id;
    write->image = trace->of.has_images ? trace->of.image : NULL;
    write->few = search->bins.turns.known ? trace->of.few : NULL;
    for (int k = 0; k < search->scene.ndim; k++) {
        write->p[k] = (write->by_S ? asking->originals[k] : asking->x[k]) + first;
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        write->column[r] = lattice->vector_of_row[r];
        write->turns[r] = turned ? asking->turns.narrow[r] + first : NULL;
    }
}

/* Where the pairs go. */
static void
direct(const hs_recorder *recorder, hs_write *write)
{
    const hs_output *output = recorder->output;
    write->index_bytes = output->index_bytes;
    write->i = hs_output_next(output, HS_WANT_I);
    write->j = hs_output_next(output, HS_WANT_J);
    write->distance = hs_recorder_distances(recorder);
    write->vector = hs_output_next(output, HS_WANT_VECTOR);
    write->shift = hs_output_next(output, HS_WANT_SHIFT);
}

hs_status
hs_write_hits(hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits,
              bool *written)
{
    const hs_search *search = scanner->search;
    *written = false;
    if (!can_write(recorder, scanner)) {
        return HS_OK;
    }
    const bool is_measured = recorder->columns & HS_MEASURED;
    if (hs_records_load(&scanner->trace.of, is_measured) != HS_OK) {
        return HS_ERR_INTERRUPTED;
    }
    hs_write write = {
        .ndim = search->scene.ndim, .is_half = search->is_half, .metric = &search->scene.metric};
    hs_measures_tell(&search->scene, &search->call->options, &write);
    describe(scanner, is_measured, first, &write);
    memset(scanner->block.hits + hits->end[hits->n - 1], 0, HS_PADDING * sizeof(int32_t));
    direct(recorder, &write);
    *written = search->call->kernel->write(&write, hits);
    return HS_OK;
}
