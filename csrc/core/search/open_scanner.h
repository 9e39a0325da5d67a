/* SPDX-License-Identifier: BSD-3-Clause */
/* open_scanner.h: opens scanners, makes them ready for another search, closes them. */
#ifndef HS_OPEN_SCANNER_H
#define HS_OPEN_SCANNER_H

#include "scanner.h"

/*
 * A scanner for blocks of so many candidates and runs; no visitor yet. is_ordered: each point's
 * hits come in one visit, ascending by the candidate's number and then by S, for which the whole
 * neighbourhood must fit the block. On failure it may be closed.
 */
hs_status hs_scanner_init(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                          bool is_ordered, hs_scanner *scanner);

/* Makes it ready for what its search has become, as hs_scanner_init without an order would, if its
 * memory will do: false where it will not, or where it has none. */
bool hs_scanner_renew(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                      hs_scanner *scanner);

/* Adds what was done to that of the call. */
void hs_scanner_note(hs_search *search, hs_scanner *scanner);

/* hs_scanner_note, and frees; harmless twice. */
void hs_scanner_close(hs_search *search, hs_scanner *scanner);

/* The arrays for pairs to decide, where hs_scanner_init has left them for later: trace.memory is
 * NULL. They are kept (hs_account_keep) where the walker is. */
hs_status hs_scanner_open_trace(hs_scanner *scanner);

#endif
