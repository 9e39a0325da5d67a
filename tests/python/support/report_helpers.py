# SPDX-License-Identifier: BSD-3-Clause
"""Helpers of the report's tests: made-up rows, a page parsed, libraries that misbehave."""

import sys
import textwrap
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np

from halfshell_report.measure import Patience
from halfshell_report.rows import ReportRow


def row(method, kind="halfshell", **other):
    blank = ReportRow("s", "a scene", 10, 3, 1.0, "open", kind, method, pairs_true=1000, missed=0,
                      spurious=0, duplicate=0, seconds=1.0, seconds_least=1.0)  # fmt: skip
    return replace(blank, **other)


def bare(method, status, **other):
    return row(method, "peer", status=status, missed=None, spurious=None, duplicate=None,
               pairs_true=None, seconds=None, **other)  # fmt: skip


def parse(page):
    head, _, rest = page.partition("\n")
    assert head == "<!DOCTYPE html>"
    return ElementTree.fromstring(rest)


def question(**other):
    scene = {"points": np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]), "cutoff": 1.0, "rows": None,
             "periodic": (), "patience": Patience(1, 0.01), "pairs": 1}  # fmt: skip
    return {**scene, **other}


def fake(prepare, module="json"):
    """A command that runs the worker with a library whose `prepare` is this code."""
    code = f"""
        import importlib, os, time
        import numpy as np
        from halfshell_report.peers import LIBRARIES, Library
        from halfshell_report.measure import serve

        class Fake(Library):
            name = "fake"
            distribution = "numpy"
            module = "{module}"

            def prepare(self, question):
                {prepare}

        LIBRARIES["fake"] = Fake()
        raise SystemExit(serve("fake"))
    """
    return [sys.executable, "-c", textwrap.dedent(code)]
