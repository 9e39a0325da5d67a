# SPDX-License-Identifier: BSD-3-Clause
"""Every status of the core is an exception with words of its own, also those that no call of Python
ends with."""

import importlib.util
import re

import numpy as np
import pytest

import halfshell as hs
from c_builds import build_extension, needs_c
from checkout import CSRC, SUPPORT

PROBE = SUPPORT / "probe_errors.c"


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


#: What each status raises, with the values of the probe's failure.
RAISED = {
    "HS_ERR_MEMORY": (MemoryError, "the result would not fit: about 7 pairs"),
    "HS_ERR_CUTOFF": (ValueError, "cutoff must be finite and not negative, got 0.5"),
    "HS_ERR_NOT_FINITE": (ValueError, "points must be finite, got points[3, 1] = 0.5"),
    "HS_ERR_BOX_FINITE": (ValueError, "box must be finite, got box[3, 1] = 0.5"),
    "HS_ERR_BOX_DEPENDENT": (ValueError, "vector 3 of box is zero; make that axis not periodic"),
    "HS_ERR_BOX_SKEWED": (ValueError, "points[3] lies so far from box, along a direction"),
    "HS_ERR_TOO_MANY": (OverflowError, "fewer than 2**31 points and systems and 2**62 pairs"),
    "HS_ERR_SHIFT_RANGE": (OverflowError, "points[3] lies too many box vectors away"),
    "HS_ERR_ROUNDING": (OverflowError, "points[3] lies so far from the box"),
    "HS_ERR_KERNEL": (ValueError, "kernel must be one of ('scalar',) on this CPU, got"),
    "HS_ERR_INTERRUPTED": (SystemError, "interrupted without an exception"),
    "HS_ERR_FAR": (ValueError, "queries[3, 1] = 0.5 lies too far from the points and the box"),
    "HS_ERR_CAPACITY": (hs.CapacityError, "out is too small: there are 7 pairs"),
    "HS_ERR_EDGES": (ValueError, "edges must be finite, not negative and ascending, got edges[3]"),
    "HS_ERR_TYPES": (ValueError, "types must be from 0 on and below the number of types"),
    "HS_ERR_WEIGHTS": (ValueError, "weights must be finite, got weights[3] = 0.5"),
    "HS_ERR_RADII": (ValueError, "radii must be finite, not negative, and of ordinary size, got"),
    "HS_ERR_SUPPORTS": (ValueError, "supports must be finite, symmetric and positive definite"),
    "HS_ERR_SUPPORT_REACH": (ValueError, "supports must reach at most 2**1022"),
    "HS_ERR_EXTENT": (ValueError, "extent must be finite and not negative, got 0.5"),
    "HS_ERR_ARGUMENT": (ValueError, "an argument is out of its range, or an array is missing"),
    "HS_ERR_KEY": (KeyError, "'a key is missing, repeated, or has no position'"),
}


def exported(probe):
    return {name: value for name, value in vars(probe).items() if name.startswith("HS_")}


@needs_c
def test_the_probe_has_all_statuses(probe):
    text = (CSRC / "halfshell.h").read_text()
    body = re.search(r"typedef enum hs_status \{(.*?)\}", text, re.DOTALL).group(1)
    numbers = exported(probe)
    assert re.findall(r"^    (HS_\w+)", body, re.MULTILINE) == list(numbers)
    assert list(numbers.values()) == list(range(len(numbers)))
    assert set(numbers) - {"HS_OK", "HS_STATUS_END"} == set(RAISED)


@needs_c
def test_each_status_has_its_exception_and_words(probe):
    texts = set()
    for name, (kind, words) in RAISED.items():
        status = getattr(probe, name)
        with pytest.raises(kind) as caught:
            probe.raise_status(status, -1, False)
        assert caught.type is kind
        assert str(caught.value).startswith(words)
        texts.add(str(caught.value))
        for in_queries in (False, True):
            for system in (-1, 2):
                with pytest.raises(kind, match=r"^(?!unmapped)"):
                    probe.raise_status(status, system, in_queries)
    assert len(texts) == len(RAISED)


@needs_c
@pytest.mark.parametrize("number", ["HS_OK", -1, "HS_STATUS_END", 10**6])
def test_numbers_that_are_no_status_are_our_fault(probe, number):
    status = getattr(probe, number) if isinstance(number, str) else number
    with pytest.raises(SystemError, match=f"unmapped status {status}"):
        probe.raise_status(status, -1, False)
