# SPDX-License-Identifier: BSD-3-Clause
"""Shared fixtures: every kernel of this CPU, and a hypothesis profile that never wavers."""

import numpy as np
import pytest
from hypothesis import settings

import halfshell as hs

settings.register_profile(
    "halfshell", derandomize=True, deadline=None, database=None, max_examples=100
)
settings.load_profile("halfshell")


@pytest.fixture(params=hs.kernels(), scope="session")
def kernel(request):
    """The name of one kernel; a test that takes it runs once per kernel."""
    return request.param


@pytest.fixture
def rng():
    """Random numbers, the same in each run."""
    return np.random.default_rng(20260817)
