# SPDX-License-Identifier: BSD-3-Clause
"""Which warnings are errors in these tests: those of our code, not those inside other packages."""

import warnings

import numpy as np
import pytest

from checkout import PYTHON_TESTS

OURS = [path.stem for path in PYTHON_TESTS.rglob("*.py")]


def warn_in(module, category):
    """Warn as a line of that module would."""
    warnings.warn_explicit("a change is coming", category, "file.py", 1, module=module)


@pytest.mark.parametrize("category", [DeprecationWarning, FutureWarning, UserWarning])
def test_our_warnings_are_errors(category):
    shown = []
    for module in ("halfshell", "halfshell_report.scenes", *OURS):
        try:
            warn_in(module, category)
            shown.append(module)
        except category as error:
            assert str(error) == "a change is coming"
    assert shown == []


@pytest.mark.parametrize("category", [DeprecationWarning, FutureWarning, UserWarning])
def test_warnings_inside_other_packages_are_shown(category):
    for module in ("ase.atoms", "halfshells", "numpy.linalg", "os", "testing"):
        with warnings.catch_warnings(record=True) as caught:
            warn_in(module, category)
        assert [str(one.message) for one in caught] == ["a change is coming"]


def test_floating_point_warnings_inside_numpy_are_errors():
    with pytest.raises(RuntimeWarning, match="a change"):
        warn_in("numpy._core._methods", RuntimeWarning)


def test_what_we_call_wrongly_is_an_error():
    with pytest.raises(RuntimeWarning, match="divide by zero"):
        np.float64(1.0) / np.float64(0.0)
