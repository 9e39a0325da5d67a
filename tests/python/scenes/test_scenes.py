# SPDX-License-Identifier: BSD-3-Clause
"""`halfshell_report.scenes`: exact answers, the same bits everywhere, said what for."""

import importlib.util
import inspect
import re

import pytest

import halfshell as hs
from checkout import TESTS
from halfshell_report import scenes
from oracles import check, same_arrays

SOURCE = TESTS / "scene_files.py"
SPEC = importlib.util.spec_from_file_location("scene_files", SOURCE)
scene_files = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(scene_files)

KEPT = scene_files.read()
NAMES = scenes.names()
OTHERS = scenes.names(radii=True, supports=True, updates=True)
every_scene = pytest.mark.parametrize("name", NAMES)


@every_scene
def test_pairs_are_those_of_rational_arithmetic(name):
    scene = scenes.load(name, "small")
    before = scene_files.digest(scene)
    n_pairs = len(check(**scene.arguments))
    found = hs.pairs(**scene.arguments, quantities="ijS")
    for kernel in hs.kernels():
        how = scene.arguments | {"threads": 2}
        with hs.settings(kernel=kernel):
            assert same_arrays(hs.pairs(**how, quantities="ijS"), found), kernel
            assert hs.count_pairs(**how) == n_pairs, kernel
    assert scene_files.digest(scene) == before, "the search changed its input"


@every_scene
def test_a_quick_scene_is_counted_as_it_is_listed(name):
    scene = scenes.load(name, "quick")
    measured = hs.explain(**scene.arguments, measure=True).measured
    pairs = hs.count_pairs(**scene.arguments)
    assert pairs == measured["pairs"] == len(hs.pairs(**scene.arguments, quantities="i"))
    assert {"n": scene.n_points, "pairs": pairs}.items() <= KEPT[name]["quick"].items()
    # Two columns of int64, grown by steps, and what a grid and a neighbourhood take.
    assert measured["bytes_peak"] <= 2 * 16 * pairs + 500 * scene.n_points + (2 << 20)


@pytest.mark.parametrize("size", ["small", "quick", pytest.param("full", marks=pytest.mark.slow)])
def test_the_bits_are_those_that_are_written_down(size):
    for name in NAMES + OTHERS:
        scene = scenes.load(name, size)
        assert scene.n_points == KEPT[name][size]["n"]
        assert scene_files.digest(scene) == KEPT[name][size]["digest"]


def test_every_scene_is_written_down():
    assert tuple(KEPT) == NAMES + OTHERS


def test_the_page_has_the_table_of_the_docstrings():
    text = scene_files.PAGE.read_text()
    assert scene_files.page(text) == text, "python tests/scene_files.py --write"


def test_the_code_of_the_page_runs(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", scene_files.PAGE.read_text(), re.DOTALL)
    exec(compile(code, "scenes.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(NAMES)


def test_each_size_is_about_as_large_as_promised():
    for name in NAMES:
        small, quick, full = (KEPT[name][size]["n"] for size in scenes.SIZES)
        assert 1 <= small <= 300
        assert small < quick <= 10_000
        assert quick < full <= 1_000_000
        assert KEPT[name]["full"]["pairs"] <= 20_000_000


def test_scenes_say_what_they_are_and_what_they_stress():
    for name in NAMES:
        scene = scenes.load(name, "small")
        assert scene.name == name
        assert 10 <= len(scene.title) <= 80
        assert "\n" not in scene.title
        assert len(scene.stresses) > 40
        assert scene.stresses == inspect.cleandoc(scene.stresses)


@pytest.mark.parametrize(
    ("name", "nearest"),
    [("fcc-shel", "fcc-shell"), ("Plummer", "plummer"), ("offset-1e5", "offset-1e15"), ("", "")],
)
def test_an_unknown_name_is_told_the_nearest_ones(name, nearest):
    with pytest.raises(ValueError, match=f"no scene '{name}'; the nearest are .*{nearest}"):
        scenes.load(name)


@pytest.mark.parametrize("size", ["", "Full", "medium"])
def test_an_unknown_size_is_told_the_three(size):
    with pytest.raises(ValueError, match="one of small, quick, full"):
        scenes.load("uniform", size)


def test_examples_of_the_scenes_run():
    doctest = importlib.import_module("doctest")
    for part in ("_catalogue",):
        module = importlib.import_module(f"halfshell_report.scenes.{part}")
        failures, count = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)
        assert (failures, count > 2) == (0, True)
