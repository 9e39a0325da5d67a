/* SPDX-License-Identifier: BSD-3-Clause */
/* sift.c: four pairs at a time with SSE2, which every x86-64 CPU has, else one by one. Which pairs
 * are unsure may differ; the pairs in the end do not. */
#include "sift.h"

#if defined(__SSE2__) || defined(_M_X64)
#include <emmintrin.h>
#define HAS_SSE2 1
#define AHEAD    2048 /* bytes */
#else
#define HAS_SSE2 0
#endif

/* Adds one pair to the lists. */
HS_ALWAYS_INLINE void
put(float square, hs_thresholds limit, int32_t e, uint16_t *hits, int32_t *n_hits, uint16_t *unsure,
    int32_t *n_unsure)
{
    hits[*n_hits] = (uint16_t)e;
    unsure[*n_unsure] = (uint16_t)*n_hits;
    *n_unsure += !(square < limit.in) && !(square > limit.out);
    *n_hits += !(square > limit.out);
}

HS_ALWAYS_INLINE float
square_of(const hs_sift_pairs *pairs, int32_t e, const int stride, const bool shifted)
{
    const float *p = pairs->y + (int64_t)pairs->i[e] * stride;
    const float *q = pairs->y + (int64_t)pairs->j[e] * stride;
    const float *offset = shifted ? pairs->offset + (int64_t)pairs->code[e] * stride : NULL;
    float        square = 0.0f;
    for (int k = 0; k < stride; k++) {
        const float apart = q[k] - p[k];
        const float along = shifted ? apart + offset[k] : apart;
        square += along * along;
    }
    return square;
}

#if HAS_SSE2
/* D of one pair. */
HS_ALWAYS_INLINE __m128
difference_of(const hs_sift_pairs *pairs, int32_t e, const bool shifted)
{
    const __m128 p = _mm_loadu_ps(pairs->y + (int64_t)pairs->i[e] * 4);
    const __m128 q = _mm_loadu_ps(pairs->y + (int64_t)pairs->j[e] * 4);
    const __m128 apart = _mm_sub_ps(q, p);
    return shifted ? _mm_add_ps(apart, _mm_loadu_ps(pairs->offset + (int64_t)pairs->code[e] * 4))
                   : apart;
}

/* |D|^2 of pairs e to e + 3. */
HS_ALWAYS_INLINE __m128
squares_of(const hs_sift_pairs *pairs, int32_t e, const bool shifted)
{
    __m128 a = difference_of(pairs, e, shifted), b = difference_of(pairs, e + 1, shifted);
    __m128 c = difference_of(pairs, e + 2, shifted), d = difference_of(pairs, e + 3, shifted);
    a = _mm_mul_ps(a, a);
    b = _mm_mul_ps(b, b);
    c = _mm_mul_ps(c, c);
    d = _mm_mul_ps(d, d);
    const __m128 ab = _mm_add_ps(_mm_unpacklo_ps(a, b), _mm_unpackhi_ps(a, b));
    const __m128 cd = _mm_add_ps(_mm_unpacklo_ps(c, d), _mm_unpackhi_ps(c, d));
    return _mm_add_ps(_mm_movelh_ps(ab, cd), _mm_movehl_ps(cd, ab));
}

/* A list is too long for the caches, and one test too short for hardware to read ahead enough. */
HS_ALWAYS_INLINE void
prefetch(const int32_t *numbers, int32_t e)
{
    _mm_prefetch((const char *)((uintptr_t)(numbers + e) + AHEAD), _MM_HINT_T0);
}

/* Whole groups of four; returns how many pairs that is. */
HS_ALWAYS_INLINE int32_t
sift_fours(const hs_sift_pairs *pairs, const bool shifted, uint16_t *hits, int32_t *n_hits,
           uint16_t *unsure, int32_t *n_unsure)
{
    const __m128 in = _mm_set1_ps(pairs->limit.in), out = _mm_set1_ps(pairs->limit.out);
    int32_t      e = 0, n = *n_hits;
    for (; e + 4 <= pairs->n; e += 4) {
        prefetch(pairs->i, e);
        prefetch(pairs->j, e);
        const __m128   square = squares_of(pairs, e, shifted);
        const unsigned kept = (unsigned)_mm_movemask_ps(_mm_cmpngt_ps(square, out));
        const unsigned open = (unsigned)_mm_movemask_ps(_mm_cmpnlt_ps(square, in)) & kept;
        const int32_t  before = n;
        for (int b = 0; b < 4; b++) {
            hits[n] = (uint16_t)(e + b);
            n += kept >> b & 1;
        }
        if (HS_UNLIKELY(open != 0)) {
            for (int b = 0, at = before; b < 4; at += kept >> b & 1, b++) {
                unsure[*n_unsure] = (uint16_t)at;
                *n_unsure += open >> b & 1;
            }
        }
    }
    *n_hits = n;
    return e;
}
#endif

HS_ALWAYS_INLINE int32_t
sift_all(const hs_sift_pairs *pairs, const int stride, const bool shifted, uint16_t *hits,
         uint16_t *unsure, int32_t *n_unsure)
{
    int32_t e = 0, n_hits = 0;
    *n_unsure = 0;
#if HAS_SSE2
    if (stride == 4) {
        e = sift_fours(pairs, shifted, hits, &n_hits, unsure, n_unsure);
    }
#endif
    for (; e < pairs->n; e++) {
        put(square_of(pairs, e, stride, shifted), pairs->limit, e, hits, &n_hits, unsure, n_unsure);
    }
    return n_hits;
}

int32_t
hs_sift(const hs_sift_pairs *pairs, uint16_t *hits, uint16_t *unsure, int32_t *n_unsure)
{
    if (pairs->stride == 4) {
        return pairs->code != NULL ? sift_all(pairs, 4, true, hits, unsure, n_unsure)
                                   : sift_all(pairs, 4, false, hits, unsure, n_unsure);
    }
    return pairs->code != NULL ? sift_all(pairs, 8, true, hits, unsure, n_unsure)
                               : sift_all(pairs, 8, false, hits, unsure, n_unsure);
}
