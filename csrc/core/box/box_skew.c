/* SPDX-License-Identifier: BSD-3-Clause */
/* box_skew.c: tests of the reduced basis: how flat it is, and how large its coefficients are. */
#include "lattice.h"

#include <math.h>

/* Least height of a reduced basis in its row, with much room: 8 rows may have 2^-4. */
#define LEAST_HEIGHT 0x1p-20
/* More than an int32 component of S holds. */
#define MOST_OF_A_ROW 0x1p32

bool
hs_skew_is_left(const hs_lattice *lattice)
{
    for (int k = 0; k < lattice->ndim && !lattice->aligned; k++) {
        const int r = lattice->row_of_axis[k];
        double    largest = 0.0;
        for (int c = 0; r >= 0 && c < lattice->ndim; c++) {
            largest = hs_larger(fabs(lattice->rows[r][c]), largest);
        }
        for (int l = 0; r >= 0 && l < lattice->n_periodic; l++) {
            if (fabs((double)lattice->U[r][l]) >= MOST_OF_A_ROW) {
                return true;
            }
        }
        if (r >= 0 && !(lattice->period[k] >= LEAST_HEIGHT * largest)) {
            return true;
        }
    }
    return false;
}

hs_status
hs_skew_or_memory(const hs_lattice *lattice)
{
    return hs_skew_is_left(lattice) ? HS_ERR_BOX_SKEWED : HS_ERR_MEMORY;
}
