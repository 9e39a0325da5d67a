# SPDX-License-Identifier: BSD-3-Clause
"""What a release is made of agrees: versions, interpreters, requirements."""

import re
import tomllib

import halfshell as hs
from checkout import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
RECIPE = (ROOT / ".ci/conda/recipe.yaml").read_text()
CLASSIFIER = "Programming Language :: Python :: 3."


def test_the_recipe_has_the_version_and_the_requirements():
    assert f'version: "{hs.__version__}"\n' in RECIPE
    host = RECIPE.split("host:")[1].split("run:")[0]
    needed = {re.sub("[>=]+", r" \g<0>", name) for name in PROJECT["build-system"]["requires"]}
    assert set(re.findall(r"- (.+)", host)) == needed | {"python", "pip"}


def test_the_recipe_and_the_project_have_one_command():
    ((name, target),) = PROJECT["project"]["scripts"].items()
    assert f"- {name} = {target}\n" in RECIPE


def test_wheels_are_built_for_the_interpreters_that_the_project_names():
    named = {
        f"cp3{one.removeprefix(CLASSIFIER)}"
        for one in PROJECT["project"]["classifiers"]
        if one.startswith(CLASSIFIER)
    }
    built = {one.removesuffix("-*") for one in PROJECT["tool"]["cibuildwheel"]["build"]}
    assert {one.removesuffix("t") for one in built} == named
