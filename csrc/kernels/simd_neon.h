/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * simd_neon.h: the vocabulary of the templates for AArch64, where NEON is part of the baseline: 4
 * lanes, little-endian.
 *
 * There is no instruction that turns a comparison into bits, so each lane keeps a bit of its own
 * and the lanes are added up. The cheaper test for "any lane" (narrow and look at 64 bits) would
 * not help: the bits are needed for every vector, to pack the labels without a branch.
 */
#ifndef HS_SIMD_NEON_H
#define HS_SIMD_NEON_H

#include "../core/base/base.h"

/* One operation a line. */
/* clang-format off */

enum { LANES = 4 };
typedef float32x4_t floats;
typedef int32x4_t   integers;
typedef unsigned    mask; /* one bit a lane */

static const uint32_t lane_bit[LANES] = {1, 2, 4, 8};

HS_ALWAYS_INLINE floats broadcast(float x) { return vdupq_n_f32(x); }
HS_ALWAYS_INLINE floats load(const float *p) { return vld1q_f32(p); }
HS_ALWAYS_INLINE floats add(floats a, floats b) { return vaddq_f32(a, b); }
HS_ALWAYS_INLINE floats subtract(floats a, floats b) { return vsubq_f32(a, b); }
HS_ALWAYS_INLINE floats multiply(floats a, floats b) { return vmulq_f32(a, b); }
/* a * b + c, rounded once. */
HS_ALWAYS_INLINE floats multiply_add(floats a, floats b, floats c) { return vfmaq_f32(c, a, b); }

/* The bits of lanes that are not all ones: `no` holds all ones or zero. */
HS_ALWAYS_INLINE mask
bits_unless(uint32x4_t no)
{
    return vaddvq_u32(vbicq_u32(vld1q_u32(lane_bit), no));
}
/* Lanes with !(a > b), set for NaN. */
HS_ALWAYS_INLINE mask not_greater(floats a, floats b) { return bits_unless(vcgtq_f32(a, b)); }
/* Lanes of m with !(a < b), set for NaN. */
HS_ALWAYS_INLINE mask
and_not_less(mask m, floats a, floats b)
{
    return m & bits_unless(vcltq_f32(a, b));
}
/* The first n of them, 1 <= n < LANES. */
HS_ALWAYS_INLINE mask first_lanes(int32_t n) { return (1u << n) - 1; }

/* The count of bits, from a word of 16 digits, one for each mask: the instruction that counts works
 * in vector registers only, and going there and back takes longer. */
HS_ALWAYS_INLINE unsigned
popcount(mask m)
{
    return (unsigned)(UINT64_C(0x4332322132212110) >> (4 * m)) & 15;
}

/* For each mask the bytes of the lanes that are set, packed to the front; behind them any. */
#define LANE(l) 4 * (l), 4 * (l) + 1, 4 * (l) + 2, 4 * (l) + 3
#define LABELS(a, b, c, d) {LANE(a), LANE(b), LANE(c), LANE(d)}
static const uint8_t packed_bytes[16][16] = {
    LABELS(0, 0, 0, 0), LABELS(0, 0, 0, 0), LABELS(1, 0, 0, 0), LABELS(0, 1, 0, 0),
    LABELS(2, 0, 0, 0), LABELS(0, 2, 0, 0), LABELS(1, 2, 0, 0), LABELS(0, 1, 2, 0),
    LABELS(3, 0, 0, 0), LABELS(0, 3, 0, 0), LABELS(1, 3, 0, 0), LABELS(0, 1, 3, 0),
    LABELS(2, 3, 0, 0), LABELS(0, 2, 3, 0), LABELS(1, 2, 3, 0), LABELS(0, 1, 2, 3),
};
#undef LANE
#undef LABELS

/* Packs the lanes in m to dst, writing LANES entries; returns how many count. */
HS_ALWAYS_INLINE int32_t
append(int32_t *dst, integers a, mask m)
{
    const uint8x16_t all = vreinterpretq_u8_s32(a);
    vst1q_s32(dst, vreinterpretq_s32_u8(vqtbl1q_u8(all, vld1q_u8(packed_bytes[m]))));
    return (int32_t)popcount(m);
}

/* Packs the floats of the lanes in m to dst, writing LANES entries. */
HS_ALWAYS_INLINE void
append_floats(float *dst, floats a, mask m)
{
    const uint8x16_t all = vreinterpretq_u8_f32(a);
    vst1q_f32(dst, vreinterpretq_f32_u8(vqtbl1q_u8(all, vld1q_u8(packed_bytes[m]))));
}

HS_ALWAYS_INLINE void store(float *p, floats a) { vst1q_f32(p, a); }
HS_ALWAYS_INLINE integers broadcast_integer(int32_t a) { return vdupq_n_s32(a); }
HS_ALWAYS_INLINE integers load_integers(const int32_t *p) { return vld1q_s32(p); }
HS_ALWAYS_INLINE void store_integers(int32_t *p, integers a) { vst1q_s32(p, a); }
/* Widens to int64. */
HS_ALWAYS_INLINE void
store_wide(int64_t *p, integers a)
{
    vst1q_s64(p, vmovl_s32(vget_low_s32(a)));
    vst1q_s64(p + 2, vmovl_high_s32(a));
}
HS_ALWAYS_INLINE integers smaller(integers a, integers b) { return vminq_s32(a, b); }
HS_ALWAYS_INLINE integers larger(integers a, integers b) { return vmaxq_s32(a, b); }
/* The first n, 1 <= n < LANES; zero elsewhere. */
HS_ALWAYS_INLINE integers
keep_lanes(integers a, int32_t n)
{
    static const int32_t lane[LANES] = {0, 1, 2, 3};
    const uint32x4_t     kept = vcgtq_s32(vdupq_n_s32(n), vld1q_s32(lane));
    return vandq_s32(a, vreinterpretq_s32_u32(kept));
}
/* (float)((p[lane] + moved - centre) * unit), rounded after each step. */
HS_ALWAYS_INLINE float64x2_t
load_relative_half(const double *p, double moved, double centre, double unit)
{
    const float64x2_t z = vaddq_f64(vld1q_f64(p), vdupq_n_f64(moved));
    return vmulq_f64(vsubq_f64(z, vdupq_n_f64(centre)), vdupq_n_f64(unit));
}
HS_ALWAYS_INLINE floats
load_relative(const double *p, double moved, double centre, double unit)
{
    const float32x2_t low = vcvt_f32_f64(load_relative_half(p, moved, centre, unit));
    return vcvt_high_f32_f64(low, load_relative_half(p + 2, moved, centre, unit));
}
/* NaN where one is NaN. */
HS_ALWAYS_INLINE floats larger_of(floats a, floats b) { return vmaxq_f32(a, b); }
HS_ALWAYS_INLINE floats smaller_of(floats a, floats b) { return vminq_f32(a, b); }
HS_ALWAYS_INLINE integers
lane_numbers(void)
{
    static const int32_t lane[LANES] = {0, 1, 2, 3};
    return vld1q_s32(lane);
}
HS_ALWAYS_INLINE integers add_integers(integers a, integers b) { return vaddq_s32(a, b); }
HS_ALWAYS_INLINE integers bits_in_both(integers a, integers b) { return vandq_s32(a, b); }
HS_ALWAYS_INLINE integers bits_of(floats a) { return vreinterpretq_s32_f32(a); }
/* One more in lanes with a > b. */
HS_ALWAYS_INLINE integers
count_greater(integers counts, integers a, integers b)
{
    return vsubq_s32(counts, vreinterpretq_s32_u32(vcgtq_s32(a, b)));
}
HS_ALWAYS_INLINE int32_t largest_lane(integers a) { return vmaxvq_s32(a); }
/* to[k], lane by lane: y[number * stride + k], for k = 0, 1, 2, 3. */
HS_ALWAYS_INLINE void
load_points(const float *y, int64_t stride, const int32_t *number, floats *to)
{
    const float32x4_t   a = vld1q_f32(y + number[0] * stride);
    const float32x4_t   b = vld1q_f32(y + number[1] * stride);
    const float32x4_t   c = vld1q_f32(y + number[2] * stride);
    const float32x4_t   d = vld1q_f32(y + number[3] * stride);
    const float32x4x2_t ab = vtrnq_f32(a, b), cd = vtrnq_f32(c, d);
    to[0] = vcombine_f32(vget_low_f32(ab.val[0]), vget_low_f32(cd.val[0]));
    to[1] = vcombine_f32(vget_low_f32(ab.val[1]), vget_low_f32(cd.val[1]));
    to[2] = vcombine_f32(vget_high_f32(ab.val[0]), vget_high_f32(cd.val[0]));
    to[3] = vcombine_f32(vget_high_f32(ab.val[1]), vget_high_f32(cd.val[1]));
}

#endif
