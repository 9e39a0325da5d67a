# SPDX-License-Identifier: BSD-3-Clause
"""Calls that must be refused: at once, and in words that say what is wrong."""

import os
import re
import time

import numpy as np
import pytest

NAN, INF = float("nan"), float("inf")
# Seconds of processor time, however busy the machine is; more under sanitizers.
LIMIT = 0.5 * float(os.environ.get("HALFSHELL_SLOWDOWN", "1"))


def with_value(row, column, value, shape=(5, 3), dtype=float):
    array = np.zeros(shape, dtype)
    array[row, column] = value
    return array


def assert_refused(call, exceptions, *fragments):
    """The call raises one of `exceptions`, at once, and the message has all the fragments."""
    start = time.process_time()
    with pytest.raises(exceptions) as caught:
        call()
    elapsed = time.process_time() - start
    assert caught.type not in (RuntimeError, np.linalg.LinAlgError, SystemError)
    message = str(caught.value)
    for fragment in fragments:
        assert re.search(fragment, message), f"{fragment!r} is not in: {message}"
    assert elapsed < LIMIT, f"refused after {elapsed:.2f} s"


def check_refusals(cases):
    """Each call of {name: (call, error, pattern)}, or of a list of these, is refused so at once."""
    wrong = {}
    cases = cases if isinstance(cases, dict) else dict(enumerate(cases))
    for name, (call, kind, pattern) in cases.items():
        start = time.process_time()
        try:
            wrong[name] = f"gives {call()!r}"
        except kind as error:
            elapsed = time.process_time() - start
            if elapsed > LIMIT:
                wrong[name] = f"takes {elapsed:.2f} s"
            if not re.search(pattern, str(error)):
                wrong[name] = f"says: {error}"
    assert wrong == {}, wrong


def arrays_among(arguments):
    """(call, name) of each array of {call: {name: argument}}."""
    return [
        (call, name)
        for call, given in arguments.items()
        for name, value in given.items()
        if isinstance(value, np.ndarray)
    ]
