/* SPDX-License-Identifier: BSD-3-Clause */
/* places_avx512.h: beside wide_avx512.h, int32 lanes and what moves reals between arrays of
 * structures and lanes: the vocabulary of write_template.h for AVX-512 (F, DQ, VL). */
#ifndef HS_PLACES_AVX512_H
#define HS_PLACES_AVX512_H

#include "wide_avx512.h"
#include "write.h"

/* One operation a line. */
/* clang-format off */

typedef __m256i  places; /* int32, as many as there are reals */
typedef __mmask8 marks;  /* truth about places */

HS_ALWAYS_INLINE places broadcast_place(int32_t a) { return _mm256_set1_epi32(a); }
/* Of two of them. */
HS_ALWAYS_INLINE reals
load_two_records(const double *from, int32_t first, int32_t second)
{
    const __m256d low = _mm256_loadu_pd(from + (int64_t)first * 2 * HS_RECORD);
    const __m256d high = _mm256_loadu_pd(from + (int64_t)second * 2 * HS_RECORD);
    return _mm512_insertf64x4(_mm512_castpd256_pd512(low), high, 1);
}
/* Four entries of each of LANES hs_candidate, from the first or the fifth on. */
HS_ALWAYS_INLINE void
load_records(const double *from, const int32_t *at, reals *entries)
{
    const __m512i low = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13);
    const __m512i high = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
    const reals   a = load_two_records(from, at[0], at[4]);
    const reals   b = load_two_records(from, at[1], at[5]);
    const reals   c = load_two_records(from, at[2], at[6]);
    const reals   d = load_two_records(from, at[3], at[7]);
    const reals   ab_even = _mm512_unpacklo_pd(a, b), ab_odd = _mm512_unpackhi_pd(a, b);
    const reals   cd_even = _mm512_unpacklo_pd(c, d), cd_odd = _mm512_unpackhi_pd(c, d);
    entries[0] = _mm512_permutex2var_pd(ab_even, low, cd_even);
    entries[1] = _mm512_permutex2var_pd(ab_odd, low, cd_odd);
    entries[2] = _mm512_permutex2var_pd(ab_even, high, cd_even);
    entries[3] = _mm512_permutex2var_pd(ab_odd, high, cd_odd);
}
/* The first, and the second, of the two places that each lane has the bits of. */
HS_ALWAYS_INLINE places
even_places(reals a)
{
    return _mm512_cvtepi64_epi32(_mm512_castpd_si512(a));
}
HS_ALWAYS_INLINE places
odd_places(reals a)
{
    return _mm512_cvtepi64_epi32(_mm512_srli_epi64(_mm512_castpd_si512(a), 32));
}
HS_ALWAYS_INLINE places add_places(places a, places b) { return _mm256_add_epi32(a, b); }
HS_ALWAYS_INLINE places lower_place(places a, places b) { return _mm256_min_epi32(a, b); }
HS_ALWAYS_INLINE places higher_place(places a, places b) { return _mm256_max_epi32(a, b); }
HS_ALWAYS_INLINE marks place_below(places a, places b) { return _mm256_cmplt_epi32_mask(a, b); }
HS_ALWAYS_INLINE marks place_equal(places a, places b) { return _mm256_cmpeq_epi32_mask(a, b); }
HS_ALWAYS_INLINE marks both_marks(marks a, marks b) { return a & b; }
HS_ALWAYS_INLINE marks either_mark(marks a, marks b) { return a | b; }
/* One bit a lane. */
HS_ALWAYS_INLINE unsigned mark_bits(marks m) { return m; }
HS_ALWAYS_INLINE truth widen_marks(marks m) { return m; }
/* -a where m. */
HS_ALWAYS_INLINE places
negate_places(marks m, places a)
{
    return _mm256_mask_sub_epi32(a, m, _mm256_setzero_si256(), a);
}
/* a b + c, and c - a b, rounded once. */
HS_ALWAYS_INLINE reals add_product(reals a, reals b, reals c) { return _mm512_fmadd_pd(a, b, c); }
HS_ALWAYS_INLINE reals
subtract_product(reals a, reals b, reals c)
{
    return _mm512_fnmadd_pd(a, b, c);
}
/* About 1 / sqrt(a): within 2^-11 of it, of itself, for a from 2^-120 to 2^120. */
HS_ALWAYS_INLINE reals guess_inverse_root(reals a) { return _mm512_rsqrt14_pd(a); }
HS_ALWAYS_INLINE void put_places(int32_t *to, places a) { _mm256_storeu_si256((__m256i *)to, a); }
HS_ALWAYS_INLINE void
put_wide_places(int64_t *to, places a)
{
    _mm512_storeu_si512(to, _mm512_cvtepi32_epi64(a));
}
/* x y, x y, ... */
HS_ALWAYS_INLINE void
put_two_reals(double *to, reals x, reals y)
{
    const __m512i first = _mm512_setr_epi64(0, 8, 1, 9, 2, 10, 3, 11);
    const __m512i second = _mm512_setr_epi64(4, 12, 5, 13, 6, 14, 7, 15);
    _mm512_storeu_pd(to, _mm512_permutex2var_pd(x, first, y));
    _mm512_storeu_pd(to + 8, _mm512_permutex2var_pd(x, second, y));
}
/* x y z, x y z, ... */
HS_ALWAYS_INLINE void
put_three_reals(double *to, reals x, reals y, reals z)
{
    const __m512i xy0 = _mm512_setr_epi64(0, 8, 0, 1, 9, 0, 2, 10);
    const __m512i xy1 = _mm512_setr_epi64(0, 3, 11, 0, 4, 12, 0, 5);
    const __m512i xy2 = _mm512_setr_epi64(13, 0, 6, 14, 0, 7, 15, 0);
    const __m512i z0 = _mm512_setr_epi64(0, 1, 8, 3, 4, 9, 6, 7);
    const __m512i z1 = _mm512_setr_epi64(10, 1, 2, 11, 4, 5, 12, 7);
    const __m512i z2 = _mm512_setr_epi64(0, 13, 2, 3, 14, 5, 6, 15);
    _mm512_storeu_pd(to, _mm512_permutex2var_pd(_mm512_permutex2var_pd(x, xy0, y), z0, z));
    _mm512_storeu_pd(to + 8, _mm512_permutex2var_pd(_mm512_permutex2var_pd(x, xy1, y), z1, z));
    _mm512_storeu_pd(to + 16, _mm512_permutex2var_pd(_mm512_permutex2var_pd(x, xy2, y), z2, z));
}
HS_ALWAYS_INLINE void
put_two_places(int32_t *to, places x, places y)
{
    const __m512i both = _mm512_inserti32x8(_mm512_castsi256_si512(x), y, 1);
    const __m512i order = _mm512_setr_epi32(0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15);
    _mm512_storeu_si512(to, _mm512_permutexvar_epi32(order, both));
}
HS_ALWAYS_INLINE void
put_three_places(int32_t *to, places x, places y, places z)
{
    const __m512i xy = _mm512_inserti32x8(_mm512_castsi256_si512(x), y, 1);
    const __m512i third = _mm512_castsi256_si512(z);
    const __m512i first = _mm512_setr_epi32(0, 8, 16, 1, 9, 17, 2, 10, 18, 3, 11, 19, 4, 12, 20, 5);
    const __m512i second = _mm512_setr_epi32(13, 21, 6, 14, 22, 7, 15, 23, 0, 0, 0, 0, 0, 0, 0, 0);
    const __m512i rest = _mm512_permutex2var_epi32(xy, second, third);
    _mm512_storeu_si512(to, _mm512_permutex2var_epi32(xy, first, third));
    _mm256_storeu_si256((__m256i *)(to + 16), _mm512_castsi512_si256(rest));
}

#endif
