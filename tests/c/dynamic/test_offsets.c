/* SPDX-License-Identifier: BSD-3-Clause */
/* test_offsets.c: each offset of the cube once, nearest first, as far as lists are not too long. */
#include "../../../csrc/core/dynamic/offsets.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"

void test_offsets(void);

static int
least_of(const uint8_t *slot, int ndim)
{
    int least = 0;
    for (int k = 0; k < ndim; k++) {
        const int offset = abs(slot[k] - HS_MOST_REACH);
        least += offset > 1 ? (offset - 1) * (offset - 1) : 0;
    }
    return least;
}

static void
offsets_come_nearest_first(void)
{
    for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
        hs_lattice lattice;
        hs_axes    axes;
        hs_offsets offsets;
        hs_lattice_init(NULL, ndim, hs_scale_of(0), &lattice);
        hs_axes_init(&axes, &lattice, 0.25, false, 1.0);
        CHECK(hs_offsets_init(&offsets, &axes, &lattice, 1.0));
        CHECK(offsets.reach == (ndim <= 3 ? 5 : ndim == 4 ? 4 : ndim == 5 ? 2 : 1));
        for (int reach = 0; reach <= offsets.reach; reach++) {
            const hs_offset_list *list = &offsets.list[reach];
            int64_t               n = 1;
            for (int k = 0; k < ndim; k++)
                n *= 2 * reach + 1;
            CHECK(list->n == n);
            for (int64_t o = 0; o < n; o++) {
                const uint8_t *slot = list->slot + o * ndim;
                for (int k = 0; k < ndim; k++)
                    CHECK(abs(slot[k] - HS_MOST_REACH) <= reach);
                CHECK(o == 0 || least_of(slot, ndim) >= least_of(slot - ndim, ndim));
            }
        }
        hs_offsets_free(&offsets);
        if (ndim <= 2) { /* a little more than four cells are five, and one more */
            CHECK(hs_offsets_init(&offsets, &axes, &lattice, 1.01) && offsets.reach == 6);
            hs_offsets_free(&offsets);
        }
    }
}

/* Where all space is one cell, there is no other to look at. */
static void
one_cell_has_no_neighbours(void)
{
    hs_lattice lattice;
    hs_axes    axes;
    hs_offsets offsets;
    hs_lattice_init(NULL, 3, hs_scale_of(0), &lattice);
    hs_axes_init(&axes, &lattice, 0.25, true, 1.0);
    CHECK(hs_offsets_init(&offsets, &axes, &lattice, 1.0));
    CHECK(offsets.reach == 0 && offsets.list[0].n == 1);
    hs_offsets_free(&offsets);
}

static void
refused_memory_is_told(void)
{
    hs_lattice lattice;
    hs_axes    axes;
    hs_offsets offsets;
    hs_lattice_init(NULL, 2, hs_scale_of(0), &lattice);
    hs_axes_init(&axes, &lattice, 1.0, false, 1.0);
    for (int nth = 1; nth <= 2; nth++) {
        hs_test_fail_allocation(nth);
        CHECK(!hs_offsets_init(&offsets, &axes, &lattice, 1.0));
    }
    hs_test_fail_allocation(0);
}

void
test_offsets(void)
{
    RUN(offsets_come_nearest_first);
    RUN(one_cell_has_no_neighbours);
    RUN(refused_memory_is_told);
}
