/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * labels.h: which hits of a point their labels leave out: those of another group; those whose label
 * is equal or near, or that are among the point's partners, for excluded pairs.
 */
#ifndef HS_LABELS_H
#define HS_LABELS_H

#include "choice.h"
#include "scanner.h"

/* By what hits of a point are left out. */
typedef enum hs_label_test {
    HS_OF_OTHER_GROUP,
    HS_OF_EQUAL_LABEL,
    HS_OF_NEAR_LABEL,
    HS_OF_PARTNER
} hs_label_test;

typedef struct hs_asking {
    int32_t        itself; /* its number, where it may be among its hits; else -1 */
    const int64_t *label;  /* of all points: groups, or what excludes */
    int64_t        own;
    uint64_t       within;
    const int32_t *partner; /* ascending */
    int64_t        n_partners;
    uint64_t       bits; /* one for the last six bits of each partner */
} hs_asking;

/* The candidate that a hit is: its place in the block as it was gathered. */
HS_ALWAYS_INLINE int32_t
hs_hit_place(const hs_scanner *scanner, int32_t hit)
{
    return scanner->is_ordered ? scanner->block.origin[hit] : hit;
}

/* Its number in the caller's order. */
HS_ALWAYS_INLINE int32_t
hs_hit_number(const hs_scanner *scanner, int32_t hit)
{
    return scanner->search->bins.order[scanner->block.number[hs_hit_place(scanner, hit)]];
}

/* The test by which pairs of this point are excluded; false where none are. */
bool hs_labels_find(const hs_choice *choice, int32_t point, hs_asking *asking, hs_label_test *test);

/* Whether a test that excludes leaves out the pair of the asking point with another one. */
bool hs_labels_leave_out(const hs_asking *asking, int32_t number, hs_label_test test);

/* Moves hits [from, end) that the test does not leave out to `to`, which is not behind them;
 * returns where they end. Hits are numbers where these are scanned for, else as scans list them. */
int32_t hs_labels_sift(const hs_scanner *scanner, hs_scan *scan, const hs_asking *asking,
                       int32_t from, int32_t end, int32_t to, hs_label_test test);

/* The same by the groups of the call's choice; without groups all are moved. */
int32_t hs_labels_sift_groups(const hs_scanner *scanner, hs_scan *scan, int32_t point, int32_t from,
                              int32_t end, int32_t to);

#endif
