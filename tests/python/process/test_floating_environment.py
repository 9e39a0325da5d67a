# SPDX-License-Identifier: BSD-3-Clause
"""Rounding modes and flushing of subnormals, set by somebody else, change no answer; and the
caller finds the environment as it was."""

import ctypes
import ctypes.util
import platform
import sys
from contextlib import contextmanager

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import lattice, random_scene, rotation, same_arrays

ARM = platform.machine().lower() in ("arm64", "aarch64")
WINDOWS = sys.platform == "win32"
C = ctypes.CDLL("ucrtbase" if WINDOWS else ctypes.util.find_library("m") or None)

# Values of <fenv.h> ...
MODES = {"nearest": 0, "down": 0x400, "up": 0x800, "zero": 0xC00}
if ARM and not WINDOWS:
    MODES = {"nearest": 0, "up": 0x400000, "down": 0x800000, "zero": 0xC00000}
elif WINDOWS:
    MODES = {"nearest": 0, "down": 0x100, "up": 0x200, "zero": 0x300}
# ... and where fenv_t keeps the control word that can flush subnormals: (offset, size, bits).
if ARM:
    CONTROL = (8, 8, 1 << 24) if sys.platform == "darwin" else (0, 4, 1 << 24)
else:
    CONTROL = (4, 4, 0x8040) if sys.platform == "darwin" else (28, 4, 0x8040)


class Environment:
    """The floating-point environment of this thread, through the C library."""

    def __init__(self):
        self.saved = ctypes.create_string_buffer(64)
        C.fegetenv(self.saved)

    def control(self):
        """The control bits: rounding, flushing and trap masks, without the sticky flags."""
        if WINDOWS:
            return C._controlfp(0, 0)
        buffer = ctypes.create_string_buffer(64)
        C.fegetenv(buffer)
        offset, size, _ = CONTROL
        word = int.from_bytes(buffer.raw[offset : offset + size], "little")
        return word if ARM else word & ~0x3F

    def flush_subnormals(self):
        buffer = ctypes.create_string_buffer(64)
        C.fegetenv(buffer)
        offset, size, bits = CONTROL
        word = int.from_bytes(buffer.raw[offset : offset + size], "little") | bits
        ctypes.memmove(ctypes.addressof(buffer) + offset, word.to_bytes(size, "little"), size)
        C.fesetenv(buffer)

    def trap_subnormals(self):
        """An operand that is subnormal ends the process, where the CPU can trap."""
        if WINDOWS:
            C._controlfp(0, 0x80000)
            return
        buffer = ctypes.create_string_buffer(64)
        C.fegetenv(buffer)
        offset, size, _ = CONTROL
        word = int.from_bytes(buffer.raw[offset : offset + size], "little")
        word = word | 1 << 15 if ARM else word & ~0x100
        ctypes.memmove(ctypes.addressof(buffer) + offset, word.to_bytes(size, "little"), size)
        C.fesetenv(buffer)

    def restore(self):
        C.fesetenv(self.saved)


@contextmanager
def environment(mode="nearest", flush=False):
    """Round and flush like this inside; check on the way out that it still is so."""
    state = Environment()
    try:
        if WINDOWS:
            C._controlfp(MODES[mode], 0x300)
            C._controlfp(0x01000000 if flush else 0, 0x03000000)
        else:
            C.fesetround(MODES[mode])
            if flush:
                state.flush_subnormals()
        before = state.control()
        yield
        after = state.control()
    finally:
        state.restore()
        if WINDOWS:
            C._controlfp(0, 0x03000300)
    assert after == before


def subnormals_are_flushed():
    tiny = np.full(4, 5e-324)
    return not (tiny + 0.0 * tiny).any() or not (tiny * np.full(4, 1.0)).any()


SETTINGS = [
    (mode, flush) for flush in (False, True) for mode in MODES if flush or mode != "nearest"
]


def scenes():
    rng = np.random.default_rng(4)
    points, box = lattice("fcc", (3, 3, 3))
    turn = rotation(rng)
    yield "ties", points, 2.0, box
    yield "near ties", points @ turn, 2.0**0.5, box @ turn
    yield "open near ties", points @ turn, 6.0**0.5, None
    yield "random", *random_scene(rng, 200, 3, "sheared", 20, spread=3)[:3]
    yield "far", points @ turn + 1e6 * (box @ turn)[0], 2.0**0.5, box @ turn
    tiny = np.round(rng.random((30, 3)) * 40) * 5e-324
    yield "subnormal", tiny, 5e-323, None
    yield "subnormal box", tiny, 5e-323, np.eye(3) * 2e-322
    yield "tiny", rng.random((30, 3)) * 1e-160, 3e-161, None
    yield "mixed", rng.random((30, 3)) * [1.0, 1e-310, 1e-320], 0.3, np.ones(3)
    yield "float32", (points @ turn).astype(np.float32), 2.0**0.5, None
    yield "float32 subnormal", tiny.astype(np.float32) + np.float32(1e-44), 1e-44, None


SCENES = {name: rest for name, *rest in scenes()}


def test_the_test_can_change_the_environment():
    third = np.array([1.0]) / np.array([3.0])
    with environment("up"):
        up = np.array([1.0]) / np.array([3.0])
    with environment("down"):
        down = np.array([1.0]) / np.array([3.0])
    with environment(flush=True):
        flushed = subnormals_are_flushed()
    assert down[0] < up[0] and third[0] in (down[0], up[0])
    assert flushed and not subnormals_are_flushed()


@pytest.mark.parametrize("name", SCENES)
def test_same_bytes_in_every_environment(name):
    points, cutoff, box = SCENES[name]
    for kernel in hs.kernels():
        how = {"box": box, "kernel": kernel}
        searches = [
            lambda how=how: call(hs.pairs, points, cutoff, quantities="ijSdD", **how),
            lambda how=how: np.array(call(hs.count_pairs, points, cutoff, inclusive=False, **how)),
            lambda how=how: call(hs.pairs, points, cutoff, precision="double", **how),
            lambda how=how: call(hs.pairs, points, cutoff, precision="single", **how),
        ]
        for number, search in enumerate(searches):
            expected = search()
            for mode, flush in SETTINGS:
                with environment(mode, flush):
                    found = search()
                assert same_arrays(found, expected), (kernel, number, mode, flush)
        assert len(searches[0]()[0])


@pytest.mark.parametrize("threads", [1, 2])
def test_traps_of_the_caller_end_no_search(threads):
    # Python and NumPy compare numbers themselves: only what goes straight to the core.
    points, cutoff = np.array([[0.0], [1e-311], [5e-311]]), 2e-311
    box = np.array([1e-309])
    how = {"quantities": "ijSdD", "threads": threads}
    cells = hs.CellList(points, cutoff, box=box)

    def searches():
        yield call(hs.pairs, points, cutoff, box=box, **how)
        yield call(hs.pairs_between, points, points, cutoff, box=box, **how)
        yield hs.coordination(points, cutoff, threads=threads)
        yield hs.neighbors(points, cutoff, queries=points, threads=threads).indices
        yield np.array(hs.count_pairs(points, cutoff, threads=threads))
        yield cells.pairs()
        yield hs.CellList(points, cutoff).cell_of(points)

    expected = list(searches())
    state = Environment()
    try:
        state.trap_subnormals()
        found = list(searches())
    finally:
        state.restore()
        if WINDOWS:
            C._controlfp(0x80000, 0x80000)
    assert all(map(same_arrays, found, expected))
    assert len(found[0][0]) == 1
