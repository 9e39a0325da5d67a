/* SPDX-License-Identifier: BSD-3-Clause */
/* basis_checks.h: exact comparisons, exact determinants and a measure of shape. */
#ifndef HS_BASIS_CHECKS_H
#define HS_BASIS_CHECKS_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "../../../csrc/core/box/lattice_reduce.h"
#include "bigint.h"

typedef double matrix[HS_MAX_DIM][HS_MAX_DIM];

/* C11 does not add this qualifier by itself. */
static inline const double (*as_const(matrix a))[HS_MAX_DIM]
{
    return (const double(*)[HS_MAX_DIM])a;
}

/* Whether entry c of row k is as close to that of U A as it is said to be. Exact. */
static inline bool
is_within_error(const hs_reduction *r, matrix a, int k, int c)
{
    big difference = big_negated(big_from_double(r->rows[k][c]));
    for (int l = 0; l < r->n_rows; l++) {
        if (r->U[k][l] != 0 && a[l][c] != 0.0) {
            difference = big_sum(difference,
                                 big_product(big_from_int(r->U[k][l]), big_from_double(a[l][c])));
        }
    }
    big error = big_from_double(r->error[k]);
    return big_compare_magnitude(&difference, &error) <= 0;
}

/* Determinants are taken modulo primes enough to tell 1 and -1 from every other value. */
enum { N_PRIMES = 18 }; /* 2^(18 * 30.9) exceeds twice (sqrt(8) 2^61)^8 */

static inline uint64_t
prime_number(int k)
{
    static uint64_t primes[N_PRIMES];
    uint64_t        p = (UINT64_C(1) << 31) + 1;
    for (int found = 0; primes[0] == 0 && found < N_PRIMES;) {
        bool is_prime = true;
        p -= 2;
        for (uint64_t d = 3; is_prime && d * d <= p; d += 2) {
            is_prime = p % d != 0;
        }
        if (is_prime) {
            if (++found == N_PRIMES) {
                primes[0] = p; /* last, for it marks the table as complete */
            } else {
                primes[found] = p;
            }
        }
    }
    return primes[k];
}

static inline uint64_t
determinant_modulo(uint64_t p, const hs_reduction *r)
{
    uint64_t a[HS_MAX_DIM][HS_MAX_DIM], determinant = 1;
    int      n = r->n_rows;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            int64_t residue = r->U[i][j] % (int64_t)p;
            a[i][j] = (uint64_t)(residue < 0 ? residue + (int64_t)p : residue);
        }
    }
    for (int k = 0; k < n; k++) {
        int pivot = k;
        while (pivot < n && a[pivot][k] == 0) {
            pivot++;
        }
        if (pivot == n) {
            return 0;
        }
        for (int c = 0; pivot != k && c < n; c++) {
            uint64_t other = a[k][c];
            a[k][c] = a[pivot][c];
            a[pivot][c] = p - other; /* so that the sign stays; may be p itself, which is 0 */
        }
        determinant = determinant * a[k][k] % p;
        uint64_t inverse = 1, power = a[k][k];
        for (uint64_t e = p - 2; e != 0; e >>= 1, power = power * power % p) {
            inverse = e & 1 ? inverse * power % p : inverse;
        }
        for (int i = k + 1; i < n; i++) {
            uint64_t factor = a[i][k] % p * inverse % p;
            for (int c = k; c < n; c++) {
                a[i][c] = (a[i][c] % p + (p - factor) * (a[k][c] % p)) % p;
            }
        }
    }
    return determinant;
}

static inline bool
is_unimodular(const hs_reduction *r)
{
    bool is_one = true, is_minus_one = true;
    for (int k = 0; k < N_PRIMES; k++) {
        uint64_t p = prime_number(k), value = determinant_modulo(p, r);
        is_one = is_one && value == 1;
        is_minus_one = is_minus_one && value == p - 1;
    }
    return is_one || is_minus_one;
}

/* Product of the lengths over the volume: 1 when orthogonal. */
static inline double
defect_of(int ndim, int n, matrix rows)
{
    matrix star;
    double defect = 1.0;
    for (int k = 0; k < n; k++) {
        double length2 = 0.0, height2 = 0.0, largest = 0.0;
        for (int c = 0; c < ndim; c++) {
            largest = fmax(largest, fabs(rows[k][c]));
        }
        for (int c = 0; c < ndim; c++) {
            star[k][c] = rows[k][c] / largest;
            length2 += star[k][c] * star[k][c];
        }
        for (int j = 0; j < 2 * k; j++) { /* twice is enough (Kahan) */
            double along = 0.0;
            for (int c = 0; c < ndim; c++) {
                along += star[k][c] * star[j % k][c];
            }
            for (int c = 0; c < ndim; c++) {
                star[k][c] -= along * star[j % k][c];
            }
        }
        for (int c = 0; c < ndim; c++) {
            height2 += star[k][c] * star[k][c];
        }
        for (int c = 0; c < ndim; c++) {
            star[k][c] /= sqrt(height2);
        }
        defect *= sqrt(length2 / height2);
    }
    return defect;
}

#endif
