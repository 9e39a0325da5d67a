# SPDX-License-Identifier: BSD-3-Clause
"""The self-test passes here, is quick, and notices every kind of wrong answer."""

import subprocess
import sys
import time

import numpy as np
import pytest

import halfshell as hs
from halfshell import selftest


def test_passes_within_five_seconds():
    lines = []
    start = time.process_time()  # of this process alone, however busy the machine is
    assert selftest.run(lines.append) == 0
    assert time.process_time() - start < 5
    assert len(lines) == len(list(selftest.cases())) + 3
    assert all(line.startswith("  ok") for line in lines[1:-1])
    assert all(kernel in lines[0] for kernel in hs.kernels())
    assert " 0 failed" in lines[-1]


def test_runs_as_a_module():
    done = subprocess.run(
        [sys.executable, "-m", "halfshell.selftest"], capture_output=True, text=True, check=True
    )
    assert " 0 failed" in done.stdout


def drop_last(i, j, S, d):
    return i[:-1], j[:-1], S[:-1], d[:-1]


def add_far_pair(i, j, S, d):
    return np.r_[i, 0], np.r_[j, 99], np.r_[S, S[:1]], np.r_[d, 1.0]


def repeat_last(i, j, S, d):
    return np.r_[i, i[-1]], np.r_[j, j[-1]], np.r_[S, S[-1:]], np.r_[d, d[-1]]


def wrong_shift(i, j, S, d):
    return i, j, S + 1, d


def beyond_cutoff(i, j, S, d):
    return i, j, S, d + 1.0


def off_by_two_ulp(i, j, S, d):
    return i, j, S, d * (1 - 2.0**-51)


def fails(*_):
    raise MemoryError("nothing left")


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (drop_last, "1 missed"),
        (add_far_pair, "1 spurious"),
        (repeat_last, "1 duplicate"),
        (wrong_shift, "spurious"),
        (beyond_cutoff, "contradicts"),
        (off_by_two_ulp, "ulp"),
        (fails, "MemoryError: nothing left"),
    ],
)
def test_notices_a_wrong_answer(monkeypatch, capsys, spoil, complaint):
    found = hs.pairs
    points = np.random.default_rng(1).random((120, 3))
    monkeypatch.setattr(selftest, "cases", lambda: [selftest.Case("scene", points, 0.3)])
    monkeypatch.setattr(selftest, "check_large", lambda: "not today")
    monkeypatch.setattr(hs, "pairs", lambda *args, **options: spoil(*found(*args, **options)))
    assert selftest.main() == 1
    output = capsys.readouterr().out
    assert "FAIL  scene" in output
    assert complaint in output
    assert "1 passed, 1 failed" in output


def test_notices_kernels_that_differ(monkeypatch):
    found = hs.pairs

    def pairs(*args, **options):
        columns = found(*args, **options)
        kernels.append(None)
        return columns if len(kernels) == 1 else tuple(column[::-1] for column in columns)

    best = hs.kernels()[0]
    kernels = []
    monkeypatch.setattr(hs, "kernels", lambda: [best, best])
    monkeypatch.setattr(hs, "pairs", pairs)
    with pytest.raises(AssertionError, match=f"i of kernels {best} and {best} differ"):
        selftest.check_large()
