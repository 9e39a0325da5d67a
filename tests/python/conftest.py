# SPDX-License-Identifier: BSD-3-Clause
"""Shared fixtures: every kernel of this CPU, a hypothesis profile that never wavers, and whose
warnings are errors."""

import gc
import json
import os

import numpy as np
import pytest
from hypothesis import settings

import halfshell as hs
from checkout import BENCHMARKS, TESTS

settings.register_profile(
    "halfshell",
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=int(os.environ.get("HALFSHELL_EXAMPLES", "50")),
)
settings.load_profile("halfshell")


def pytest_configure(config):
    """Show what other packages warn of inside themselves, which changes with their releases.

    All other warnings are errors, as pyproject.toml says: those of our code and of its calls (they
    count as the caller's), of floating-point arithmetic inside NumPy, and of pytest.
    """
    files = [path for folder in (TESTS, BENCHMARKS) for path in folder.rglob("*.py")]
    ours = {"halfshell", "halfshell_report", "__main__", *(path.stem for path in files)}
    ours = "|".join(sorted(ours))
    for line in (
        rf"default:::(?!({ours})(\.|$))",
        "error::RuntimeWarning:numpy",
        "error::pytest.PytestWarning",
    ):
        config.addinivalue_line("filterwarnings", line)


@pytest.hookimpl(wrapper=True)
def pytest_collection(session):
    """Thousands of tests are many objects, which no collection of garbage need look at."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


# For modules: tests of a wider scope would be sorted by kernel, and oracles asked again.
@pytest.fixture(params=hs.kernels(), scope="module")
def kernel(request):
    """The name of one kernel; a test that takes it runs once per kernel."""
    return request.param


@pytest.fixture
def rng():
    """Random numbers, the same in each run."""
    return np.random.default_rng(20260817)


@pytest.fixture
def run(capsys):
    """Run ``halfshell ARGS``; return (exit status, standard output, standard error)."""
    from halfshell import cli

    def call(*args):
        status = cli.main([str(arg) for arg in args])
        return (status, *capsys.readouterr())

    return call


@pytest.fixture
def told(run):
    """Run ``halfshell ARGS --json``; return what it says."""

    def call(*args):
        status, out, err = run(*args, "--json")
        assert (status, err) == (0, ""), err
        return json.loads(out)

    return call


@pytest.fixture
def refusal(run):
    """Run ``halfshell ARGS``, which must be refused in one line; return that line."""

    def call(*args):
        status, out, err = run(*args)
        assert (status, out, err.count("\n")) == (2, "", 1), (args, out, err)
        assert err.startswith("halfshell: error: ") and "Traceback" not in err
        return err

    return call
