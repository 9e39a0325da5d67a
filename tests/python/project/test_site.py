# SPDX-License-Identifier: BSD-3-Clause
"""The site is built without a warning, every notebook runs, and it answers what newcomers ask."""

import importlib
import re
import subprocess
import sys

import pytest

import halfshell as hs
from checkout import ROOT
from halfshell import structures
from halfshell_report import scenes

DOCS = ROOT / "docs"
NEEDED = ["sphinx", "numpydoc", "myst_nb", "furo", "ipykernel", "matplotlib", "numba", "ase"]
NOTEBOOKS = [path for path in sorted(DOCS.rglob("*.md")) if "{code-cell}" in path.read_text()]
#: What makes a cell of a notebook end with a figure.
DRAWS = r"plt\.(figure|subplots)\(|\bplot_pairs\(|\.plot\("

#: What newcomers ask -> where the start page sends them.
QUESTIONS = {
    "installing": "start/ten-minutes.md#install",
    "which function": "start/which-function.md",
    "only these points": "recipes/selected-points.md",
    "cutoffs by element": "recipes/bonds.md",
    "ASE": "start/coming-from.md#ase",
    "MDAnalysis": "start/coming-from.md#mdanalysis",
    "signs and batches of a graph": "recipes/graph-batches.md",
    "adding up forces": "recipes/sums-over-pairs.md",
    "partial g(r)": "recipes/partial-rdf.md",
    "bonded pairs": "recipes/excluded-pairs.md",
    "drawing": "recipes/drawing.md",
    "platforms": "start/platforms.md",
}


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path):
    """One test, as each worker would build a site of its own."""
    for name in NEEDED:
        pytest.importorskip(name, reason=f"{name} is not installed: pip install '.[docs]'")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", str(DOCS), str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-5000:]
    for source in DOCS.rglob("*.md"):
        page = tmp_path / source.relative_to(DOCS).with_suffix(".html")
        assert page.exists(), source
        check_links(page)
        if source in NOTEBOOKS:
            check_outputs(page, source.read_text())
    for name in hs.__all__:
        text = page_of(tmp_path, name).read_text()
        assert f'id="halfshell.{name}"' in text and "toctree-l2 current" in text, name
    sidebar = re.findall(r"toctree-l(\d)", (tmp_path / "index.html").read_text())
    assert sidebar.count("1") == 9 and (tmp_path / "releasing.html").exists()


def page_of(site, name):
    """Its page: where case does not tell files apart, classes have names of their own."""
    return site / "reference/api" / f"halfshell.{name}{'-class' * (name != name.lower())}.html"


def check_links(page):
    for target in re.findall(r'<a [^>]*href="([^"#:?]+)(?:#[^"]*)?"', page.read_text()):
        assert (page.parent / target).exists(), (page, target)


def check_outputs(page, source):
    text = page.read_text()
    assert "cell_output" in text, page
    cells = re.findall(r"```\{code-cell\} ipython3\n(.*?)```", source, re.DOTALL)
    drawn = sum(bool(re.search(DRAWS, cell)) for cell in cells)
    assert len(re.findall(r"<img [^>]*_images/", text)) == drawn, page


def test_the_start_page_answers_in_one_click():
    start = (DOCS / "index.md").read_text()
    for question, target in QUESTIONS.items():
        assert f"]({target})" in start, question
        page, _, heading = target.partition("#")
        text = (DOCS / page).read_text()
        headings = re.findall(r"^##* (.*)$", text, re.MULTILINE)
        assert not heading or heading in [h.lower().replace(" ", "-") for h in headings]


def test_every_recipe_is_on_the_start_page():
    start = (DOCS / "index.md").read_text()
    for path in (DOCS / "recipes").glob("*.md"):
        assert f"](recipes/{path.name})" in start, path


def names_of_the_reference(section=""):
    """The names in the tables of the reference, of which Sphinx makes a page each."""
    text = (DOCS / "reference/index.md").read_text()
    if section:
        text = text.partition(f"## {section}\n")[2].partition("\n## ")[0]
    return re.findall(r"^   (\w+)$", text, re.MULTILINE)


def test_the_reference_has_each_name_once():
    assert sorted(names_of_the_reference()) == sorted(hs.__all__)
    text = (DOCS / "reference/scenes.md").read_text()
    named = set(re.findall(r"^\.\. auto(?:function|class):: (\w+)$", text, re.MULTILINE))
    assert "automodule:: halfshell.structures" in text and structures.__all__
    assert named - {"report"} == {name for name in scenes.__all__ if name not in ("SIZES", "Size")}


def test_drawings_are_those_of_the_script(tmp_path):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    sys.path.insert(0, str(DOCS / "figures"))
    try:
        draw = importlib.import_module("draw")
    finally:
        sys.path.remove(str(DOCS / "figures"))
    draw.main(tmp_path)
    for name in draw.DRAWINGS:
        assert (tmp_path / f"{name}.svg").stat().st_size > 5000
        assert (DOCS / "figures" / f"{name}.svg").exists()
