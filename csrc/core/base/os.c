/* SPDX-License-Identifier: BSD-3-Clause */
#include "os.h"

/* os.c: the floating-point control register on each kind of CPU. */

#if defined(__SSE2__) || defined(_M_X64)

#include <xmmintrin.h>

/* Power-on value: round to nearest, every exception masked, no flag set, no flushing. */
#define MXCSR_DEFAULT   0x1f80u
#define MXCSR_FLUSH     0x8040u /* results and operands that are subnormal count as zero */
#define MXCSR_SUBNORMAL 0x0012u /* flags: an operand was subnormal, a result was too small */
#define CAN_FLUSH       1

/* The C library of MinGW computes with the x87 unit, whose rounding is its own: the control word
 * stands above the 32 bits of MXCSR. */
#if defined(__MINGW32__)
#define X87_ROUNDING   0x0c00u
#define X87_EXCEPTIONS 0x003fu /* masks in the control word, flags in the status word */

/* What fnstenv stores: the control word and the status word are the lower halves of the first two.
 * Storing it masks all exceptions, so that no flag that stands traps at the next instruction. */
typedef struct x87_state {
    uint32_t words[7];
} x87_state;

static uint64_t
enter_x87(void)
{
    x87_state state;
    __asm__ __volatile__("fnstenv %0" : "=m"(state));
    const uint16_t control = (uint16_t)state.words[0];
    const uint16_t nearest = (uint16_t)((control & ~X87_ROUNDING) | X87_EXCEPTIONS);
    __asm__ __volatile__("fldcw %0" : : "m"(nearest));
    return control | (uint64_t)(state.words[1] & X87_EXCEPTIONS) << 16;
}

/* The caller's flags come back before its traps: those of the core would trap. */
static void
leave_x87(uint64_t saved)
{
    x87_state state;
    __asm__ __volatile__("fnstenv %0" : "=m"(state));
    state.words[0] = (state.words[0] & ~UINT32_C(0xffff)) | (uint32_t)(saved & 0xffff);
    state.words[1] = (state.words[1] & ~X87_EXCEPTIONS) | (uint32_t)(saved >> 16 & X87_EXCEPTIONS);
    __asm__ __volatile__("fnclex\n\tfldenv %0" : : "m"(state));
}
#else
#define enter_x87()      UINT64_C(0)
#define leave_x87(saved) ((void)(saved))
#endif

hs_fpenv
hs_fpenv_enter(void)
{
    const hs_fpenv saved = {_mm_getcsr() | enter_x87() << 32};
    _mm_setcsr(MXCSR_DEFAULT);
    return saved;
}

void
hs_fpenv_leave(hs_fpenv saved)
{
    leave_x87(saved.control >> 32);
    _mm_setcsr((unsigned)(saved.control & UINT32_MAX));
}

void
hs_fpenv_flush(bool on)
{
    _mm_setcsr(on ? MXCSR_DEFAULT | MXCSR_FLUSH : MXCSR_DEFAULT);
}

bool
hs_fpenv_met_subnormal(void)
{
    return (_mm_getcsr() & MXCSR_SUBNORMAL) != 0;
}

#elif defined(__aarch64__)

/* FPCR holds rounding, flushing and traps, all off when zero; FPSR the flags, which trap nothing.
 * Each is 32 bits. */
hs_fpenv
hs_fpenv_enter(void)
{
    uint64_t control, flags;
    __asm__ __volatile__("mrs %0, fpcr" : "=r"(control));
    __asm__ __volatile__("mrs %0, fpsr" : "=r"(flags));
    __asm__ __volatile__("msr fpcr, %0" : : "r"(UINT64_C(0)));
    return (hs_fpenv){(control & UINT32_MAX) | flags << 32};
}

void
hs_fpenv_leave(hs_fpenv saved)
{
    __asm__ __volatile__("msr fpcr, %0" : : "r"(saved.control & UINT32_MAX));
    __asm__ __volatile__("msr fpsr, %0" : : "r"(saved.control >> 32));
}

#elif defined(_M_ARM64)

#include <intrin.h>

hs_fpenv
hs_fpenv_enter(void)
{
    const uint64_t control = (uint64_t)_ReadStatusReg(ARM64_FPCR) & UINT32_MAX;
    const uint64_t flags = (uint64_t)_ReadStatusReg(ARM64_FPSR);
    _WriteStatusReg(ARM64_FPCR, 0);
    return (hs_fpenv){control | flags << 32};
}

void
hs_fpenv_leave(hs_fpenv saved)
{
    _WriteStatusReg(ARM64_FPCR, (__int64)(saved.control & UINT32_MAX));
    _WriteStatusReg(ARM64_FPSR, (__int64)(saved.control >> 32));
}

#else

/* Flushing cannot be reached from here; CPUs of this kind start without it. */
hs_fpenv
hs_fpenv_enter(void)
{
    hs_fpenv saved;
    (void)feholdexcept(&saved.standard); /* no flag set, and where it can be, no trap */
    (void)fesetround(FE_TONEAREST);
    return saved;
}

void
hs_fpenv_leave(hs_fpenv saved)
{
    (void)fesetenv(&saved.standard);
}

#endif

#ifndef CAN_FLUSH
void
hs_fpenv_flush(bool on)
{
    (void)on;
}

bool
hs_fpenv_met_subnormal(void)
{
    return false;
}
#endif
