/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * form.h: how a block is scanned. Its extent decides form and thresholds of the scan; groups
 * of a search have few extents, and what follows from each is kept.
 */
#ifndef HS_FORM_H
#define HS_FORM_H

#include "scanner.h"

/* None is known yet. */
void hs_forms_init(hs_scanner *scanner);

/* Sets scanner->form by the size of the present group and block. */
void hs_form_set(hs_scanner *scanner);

/* Lets candidates of the present group be left out that are beyond the cutoff of all its points, or
 * their limits, where the block has so many that this is worth it. */
void hs_form_prune(hs_scanner *scanner);

#endif
