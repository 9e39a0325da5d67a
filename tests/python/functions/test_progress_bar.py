# SPDX-License-Identifier: BSD-3-Clause
"""The bar of ``progress=True``: on a terminal, in a notebook, nowhere else, and gone at the end."""

import io
import itertools
import sys
import types

import numpy as np
import pytest

import halfshell as hs
from calls import call
from halfshell._convert import progress as bar

HIDE, SHOW = "\x1b[?25l", "\x1b[?25h"  # the cursor


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def slow(monkeypatch):
    """A clock by which each look at it takes a second."""
    seconds = iter(range(1_000_000))
    clock = types.SimpleNamespace(monotonic=lambda: float(next(seconds)))
    monkeypatch.setattr(bar, "time", clock)


@pytest.fixture
def terminal(monkeypatch):
    """Make standard error a terminal; in the test, as pytest sets it anew before that."""
    pytest.importorskip("rich")
    monkeypatch.setenv("TERM", "xterm")

    def begin():
        screen = Terminal()
        monkeypatch.setattr(sys, "stderr", screen)
        return screen

    return begin


@pytest.fixture
def points(rng):
    return rng.random((60_000, 3))


def searches(points):
    cells = hs.CellList(points, 0.08)
    return {
        "pairs": lambda progress: hs.pairs(points, 0.08, threads=1, progress=progress),
        "batch": lambda progress: call(
            hs.pairs,
            points,
            0.08,
            batch=np.arange(len(points)) // 20_000,
            threads=1,
            progress=progress,
        ),
        "blocks": lambda progress: list(hs.iter_pairs(points, 0.08, progress=progress)),
        "cells": lambda progress: cells.pairs(threads=1, progress=progress),
        "cells, blocks": lambda progress: list(cells.iter_pairs(progress=progress)),
        "frames": lambda progress: list(hs.trajectory_pairs([points] * 3, 0.08, progress=progress)),
    }


NAMES = list(searches(np.zeros((1, 3))))


def same(one, other):
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    return len(one) == len(other) and all(map(same, one, other))


@pytest.mark.parametrize("name", NAMES)
def test_a_bar_is_shown_and_goes_away(points, slow, terminal, name):
    screen = terminal()
    search = searches(points)[name]
    assert same(search(True), search(None))
    shown = screen.getvalue()
    assert "searching" in shown and shown.count(HIDE) == shown.count(SHOW) == 1


def test_nothing_is_shown_in_a_file(points, slow, monkeypatch):
    pytest.importorskip("rich")
    file = io.StringIO()
    monkeypatch.setattr(sys, "stderr", file)
    hs.pairs(points, 0.08, progress=True)
    assert file.getvalue() == ""


def test_short_searches_show_none(points, terminal, monkeypatch):
    moments = itertools.count(step=1e-6)
    monkeypatch.setattr(bar, "time", types.SimpleNamespace(monotonic=lambda: next(moments)))
    screen = terminal()
    hs.pairs(points, 0.08, progress=True)
    assert screen.getvalue() == ""


def test_errors_leave_no_bar(points, slow, terminal):
    screen = terminal()
    with pytest.raises(MemoryError):
        call(hs.pairs, points, 0.3, progress=True, threads=1, memory_limit=5e6)
    with pytest.raises(TypeError, match="box="):
        hs.pairs(points, 0.1, progress=True, cell=3)
    with pytest.raises(ValueError, match="cutoff"):
        hs.pairs(points, -1.0, progress=True)
    shown = screen.getvalue()
    assert shown.count(HIDE) == shown.count(SHOW)


def test_without_rich_the_package_is_named(points, monkeypatch):
    monkeypatch.setattr(bar, "find_spec", lambda name: None)
    for search in searches(points[:10]).values():
        with pytest.raises(ImportError, match="progress=True needs rich"):
            search(True)


def test_in_a_notebook_the_cell_has_a_bar(points, slow, monkeypatch):
    pages = []

    class Page:
        def update(self, page):
            pages.append(page)

    shell = types.SimpleNamespace(kernel=True)
    shown = types.SimpleNamespace(HTML=str, display=lambda page, display_id: Page())
    ipython = types.SimpleNamespace(get_ipython=lambda: shell, display=shown)
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", shown)
    monkeypatch.setattr(bar, "find_spec", lambda name: None)  # rich is not needed there
    hs.pairs(points, 0.08, threads=1, progress=True)
    assert len(pages) > 2 and pages[-1] == ""
    assert all('<progress max="1" value="0.' in page and "%" in page for page in pages[:-1])
