# SPDX-License-Identifier: BSD-3-Clause
"""The tests of another library, run with a module of halfshell.compat in the place of its own.

Usage: owners_tests.py OURS THEIRS TESTS [pytest's arguments]: the names of OURS, a module of
halfshell.compat, are put into THEIRS before pytest imports the module or package TESTS.
"""

import importlib
import sys

import pytest


def main(ours, theirs, tests, *arguments):
    stand_in = importlib.import_module(ours)
    original = importlib.import_module(theirs)
    for name in stand_in.__all__:
        setattr(original, name, getattr(stand_in, name))
    return pytest.main(["--pyargs", tests, "-q", "-p", "no:cacheprovider", *arguments])


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
