/* SPDX-License-Identifier: BSD-3-Clause */
/* open_scanner.c: the memory of a scanner is kept for the next search where that will do. */
#include "open_scanner.h"

#include "choice.h"
#include "form.h"
#include "limits.h"

#include <stddef.h>
#include <string.h>

/* What a choice looks at must be listed: numbers for labels, else places. */
static hs_block_use
use_of_scans(const hs_scanner *scanner)
{
    const bool lists_less = scanner->use == HS_BLOCK_COUNTS || scanner->use == HS_BLOCK_LISTS_IDS;
    if (!scanner->chooses || !lists_less) {
        return scanner->use;
    }
    return hs_choice_needs_places(scanner->search->call->choice, scanner->options.cutoff)
               ? HS_BLOCK_LISTS_PLACES
               : HS_BLOCK_LISTS_IDS;
}

/* Whether S of hits is looked up. */
static bool
needs_shifts(const hs_scanner *scanner)
{
    return scanner->use == HS_BLOCK_LISTS_PLACES ||
           (scanner->chooses &&
            hs_choice_compares(scanner->search->call->choice, scanner->options.cutoff));
}

/* Whether pairs are only looked up to decide them: then the arrays for that are made when there are
 * some, for small searches have none. By one thread alone, since the account serves one. */
static bool
looks_up_late(const hs_scanner *scanner)
{
    return (scanner->use == HS_BLOCK_COUNTS || scanner->use == HS_BLOCK_LISTS_IDS) &&
           !scanner->chooses && scanner->search->call->team == NULL;
}

static hs_status
open_trace(bool needs_given, hs_scanner *scanner)
{
    return hs_trace_init(scanner->search, &scanner->block, &scanner->options, needs_given,
                         &scanner->trace);
}

/* Sets all but what has memory. */
static void
begin(hs_search *search, hs_block_use use, bool is_ordered, hs_scanner *scanner)
{
    memset((char *)scanner + offsetof(hs_scanner, search), 0,
           sizeof *scanner - offsetof(hs_scanner, search));
    scanner->search = search;
    scanner->options = search->call->options;
    scanner->use = use;
    scanner->chooses = search->call->choice != NULL && use != HS_BLOCK_SIZES;
    scanner->scans = use_of_scans(scanner);
    scanner->is_ordered = is_ordered;
    scanner->candidate_limit = INT64_MAX;
}

hs_status
hs_scanner_init(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                bool is_ordered, hs_scanner *scanner)
{
    hs_account *account = &search->call->account;
    begin(search, use, is_ordered, scanner);
    hs_forms_init(scanner);
    scanner->trace.memory = scanner->trace.of.memory = NULL; /* freed also when never set */
    hs_status status = hs_block_init(account, search->scene.ndim, scanner->scans, capacity,
                                     most_runs, &scanner->block);
    if (status == HS_OK && search->limits != NULL) {
        status = hs_block_add_radii(account, hs_limits_rows(search), &scanner->block);
    }
    if (status == HS_OK && !looks_up_late(scanner)) {
        status = open_trace(needs_shifts(scanner), scanner);
    }
    if (status == HS_OK && is_ordered) {
        status = hs_order_init(account, &scanner->block, &scanner->order);
    }
    return status;
}

hs_status
hs_scanner_open_trace(hs_scanner *scanner)
{
    const hs_status status = open_trace(false, scanner);
    if (hs_search_keeps_walker(scanner->search)) {
        hs_account_keep(&scanner->search->call->account);
    }
    return status;
}

bool
hs_scanner_renew(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                 hs_scanner *scanner)
{
    const hs_block    *block = &scanner->block;
    const hs_block_use scans = scanner->scans;
    if (block->memory == NULL || block->radius != NULL || search->limits != NULL ||
        scanner->search != search || scanner->is_ordered || scanner->use != use ||
        capacity > block->capacity || most_runs > block->most_runs) {
        return false;
    }
    begin(search, use, false, scanner);
    return scanner->scans == scans && (scanner->trace.memory == NULL ||
                                       hs_trace_renew(needs_shifts(scanner), &scanner->trace));
}

void
hs_scanner_note(hs_search *search, hs_scanner *scanner)
{
    const hs_counters walked = {.groups = scanner->n_groups,
                                .candidates = scanner->n_candidates,
                                .ambiguous = scanner->n_ambiguous,
                                .by_float64 = scanner->stages.by_float64,
                                .by_double_word = scanner->stages.by_double_word,
                                .by_integers = scanner->stages.by_integers};
    hs_call_note(search->call, &walked);
    scanner->n_groups = scanner->n_candidates = scanner->n_ambiguous = 0;
    scanner->stages = (hs_stages){0};
}

void
hs_scanner_close(hs_search *search, hs_scanner *scanner)
{
    hs_scanner_note(search, scanner);
    hs_order_free(&search->call->account, &scanner->block, &scanner->order);
    hs_trace_free(&search->call->account, &scanner->trace);
    hs_block_free(&search->call->account, &scanner->block);
}
