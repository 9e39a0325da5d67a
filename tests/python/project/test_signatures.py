# SPDX-License-Identifier: BSD-3-Clause
"""Public signatures: every keyword is spelled out, and alike in functions and methods."""

import inspect
import re

import pytest

import halfshell as hs
import halfshell_report
from halfshell import selftest, structures
from halfshell_report import scenes

CLASSES = [value for name in hs.__all__ if inspect.isclass(value := getattr(hs, name))]
FUNCTIONS = {
    name: value for name in hs.__all__ if inspect.isfunction(value := getattr(hs, name))
}
OF_MODULES = {
    f"{module.__name__}.{name}": value
    for module in (halfshell_report, scenes, selftest, structures)
    for name in module.__all__
    if inspect.isfunction(value := getattr(module, name))
}
METHODS = {
    f"{owner.__name__}.{name}": value
    for owner in (*CLASSES, selftest.Case)
    for name, value in inspect.getmembers(owner, callable)
    if (name[0] != "_" or name == "__init__") and inspect.getmodule(value) is not None
    if inspect.getmodule(value).__name__.startswith("halfshell")
}
CALLABLES = FUNCTIONS | OF_MODULES | METHODS

#: The order of keywords that searches share; what is a function's own stands anywhere.
ORDER = """
    queries box periodic rule exclude min_distance indices inclusive quantities index_dtype threads
    progress
""".split()

MOST_KEYWORDS = 16

#: Any is the type of what is passed on or told by its behaviour.
UNTYPED = {"changes", "callback", "user_data", "fill", "dtype"}


def parameters(function):
    return inspect.signature(function).parameters


def keywords(function):
    return [
        name for name, one in parameters(function).items() if one.kind is one.KEYWORD_ONLY
    ]


def test_what_is_public_was_found():
    assert len(FUNCTIONS) > 15
    assert {"CellList.pairs", "CellList.query", "VerletList.update", "NeighborTable.sort",
            "Box.wrap", "VerletList.__init__", "Case.find"} <= set(METHODS)  # fmt: skip


def test_every_keyword_is_spelled_out():
    for name, function in CALLABLES.items():
        known = parameters(function)
        if "unknown" in known:  # is refused, with a hint
            assert known["unknown"].annotation == "Never", name
        kinds = {one.kind for key, one in known.items() if key != "unknown"}
        assert inspect.Parameter.VAR_KEYWORD not in kinds or name == "Points.replace", name
        assert len(keywords(function)) <= MOST_KEYWORDS, name
        assert inspect.Parameter.VAR_POSITIONAL not in kinds or name == "Box.orthorhombic"


def test_keywords_come_in_one_order():
    for name, function in (FUNCTIONS | METHODS).items():
        known = [keyword for keyword in keywords(function) if keyword in ORDER]
        assert known == sorted(known, key=ORDER.index), name


SHARED = [
    name for name in METHODS
    if name.split(".")[1] in FUNCTIONS and name.split(".")[0] not in ("Verdict", "Connectivity")
]  # fmt: skip


@pytest.mark.parametrize("name", SHARED)
def test_methods_have_the_keywords_of_the_functions(name):
    method, function = METHODS[name], FUNCTIONS[name.split(".")[1]]
    common = set(keywords(method)) & set(keywords(function))
    assert common
    for keyword in common:
        ours, theirs = parameters(method)[keyword], parameters(function)[keyword]
        assert (ours.default, ours.annotation) == (theirs.default, theirs.annotation), keyword
    known = parameters(function)
    assert all(keyword in known for keyword in keywords(method))
    if name.startswith("CellList."):  # box and periodicity belong to the list
        assert set(keywords(function)) - set(keywords(method)) == {"box", "periodic"}


def test_public_arguments_have_types():
    for name, function in (FUNCTIONS | METHODS).items():
        for one in parameters(function).values():
            if one.name not in UNTYPED | {"self"}:
                assert one.annotation is not one.empty, (name, one)
                assert not re.search(r"^Any\b", str(one.annotation)), (name, one)
