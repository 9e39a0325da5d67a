# SPDX-License-Identifier: BSD-3-Clause
"""Every status of the core is an exception with words of its own, also those that no call of Python
ends with."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import halfshell as hs
from c_builds import CSRC, build_extension, needs_c

PROBE = Path(__file__).with_name("probe_errors.c")
EXCEPTIONS = (ValueError, OverflowError, MemoryError, hs.CapacityError)
MEMORY, INTERRUPTED, CAPACITY, ARGUMENT = 1, 11, 13, 17


@pytest.fixture(scope="module")
def probe(tmp_path_factory):
    """The module that raises them."""
    binding = CSRC / "binding"
    path = build_extension(
        tmp_path_factory.mktemp("probe"), PROBE, "-std=c11", "-Wall", "-Wextra", "-Werror",
        f"-I{binding}", "-isystem", np.get_include(), binding / "errors.c",
        CSRC / "core/base/status.c",
    )  # fmt: skip
    spec = importlib.util.spec_from_file_location(PROBE.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@needs_c
def test_every_status_has_words(probe):
    assert probe.STATUS_END == 18, "a new status: which exceptions does it raise?"
    texts = set()
    for status in range(1, probe.STATUS_END):
        for system in (-1, 2):
            for in_queries in (False, True):
                with pytest.raises((*EXCEPTIONS, SystemError)) as caught:
                    probe.raise_status(status, system, in_queries)
                assert "unmapped" not in str(caught.value)
                assert (caught.type is SystemError) == (status == INTERRUPTED)
                texts.add(str(caught.value))
    assert len(texts) >= probe.STATUS_END - 1


@needs_c
def test_each_status_has_its_exception(probe):
    for status, exception in ((MEMORY, MemoryError), (CAPACITY, hs.CapacityError)):
        with pytest.raises(exception):
            probe.raise_status(status, -1, False)
    with pytest.raises(ValueError, match="an argument is out of its range, or an array is missing"):
        probe.raise_status(ARGUMENT, -1, False)


@needs_c
@pytest.mark.parametrize("number", [0, -1, 18, 10**6])
def test_numbers_that_are_no_status_are_our_fault(probe, number):
    with pytest.raises(SystemError, match=f"unmapped status {number}"):
        probe.raise_status(number, -1, False)
