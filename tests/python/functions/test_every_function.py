# SPDX-License-Identifier: BSD-3-Clause
"""Every function that has pairs, of everything that may be known of points: what the fractions say.

The scenes have all that can go wrong at once: ties, coincident points, units from subnormal numbers
to among the largest, boxes that are sheared or hold many images, float32 beside float64.
"""

import pytest

from definition import FORMS, Scene

SEEDS = [range(k, 60, 4) for k in range(4)]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("seeds", SEEDS, ids=str)
def test_all_pairs(form, seeds):
    assert sum(Scene(seed, form).check() for seed in seeds) > 5


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("seeds", SEEDS, ids=str)
def test_pairs_that_count(form, seeds):
    assert sum(Scene(1000 + seed, form).choose().check() for seed in seeds) > 5


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("seeds", SEEDS, ids=str)
def test_pairs_of_each_system(form, seeds):
    assert sum(Scene(2000 + seed, form, 30).choose().divide().check() for seed in seeds) > 5


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_many_more_scenes(form):
    for seed in range(60, 400):
        Scene(seed, form).choose().check()
        Scene(2000 + seed, form, 20).choose().divide().check()
