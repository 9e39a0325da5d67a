# SPDX-License-Identifier: BSD-3-Clause
"""How Sphinx builds the site: `python -m sphinx -W --keep-going docs build/site`."""

import re
from pathlib import Path

import halfshell

project = "halfshell"
author = "The halfshell developers"
project_copyright = author
version = release = halfshell.__version__

extensions = ["sphinx.ext.autodoc", "numpydoc", "myst_nb"]
source_suffix = {".md": "myst-nb"}
exclude_patterns = ["_build", "report/*.html"]
root_doc = "index"
nitpicky = True

html_theme = "furo"
html_title = "halfshell"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sphinx = False
templates_path: list[str] = []

# Pages that begin with a `jupytext` header are notebooks, run at each build. Nothing is kept.
nb_execution_mode = "force"
nb_execution_timeout = 120
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True
myst_heading_anchors = 3
myst_enable_extensions = ["dollarmath"]
myst_links_external_new_tab = False

autodoc_typehints = "none"  # the docstrings say it in words
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
numpydoc_show_class_members = False
numpydoc_xref_param_type = False


def leave_out_signature(app, what, name, _obj, _options, signature, returned):
    """Return no signature for classes that users do not call, but get; else what users may give."""
    results = Path(app.srcdir, "reference", "results.md").read_text(encoding="utf-8")
    is_result = f"autoclass:: {name.rpartition('.')[2]}\n" in results
    if what == "class" and is_result:
        return "", None
    return signature and re.sub(r", \*\*unknown\b[^,)]*", "", signature), returned


def link_public_names(_app, _what, _name, _obj, _options, lines):
    """Make `pairs` in a docstring a link, and leave `points` as it is."""
    names = "|".join(halfshell.__all__)
    for k, line in enumerate(lines):
        lines[k] = re.sub(rf"(?<![`:])`({names})`(?!`)", r":py:obj:`~halfshell.\1`", line)


def place_new_names(app, docname, source):
    """Put public names that no page of the reference mentions on the page of tools."""
    if docname == "reference/tools":
        pages = Path(app.srcdir, "reference").glob("*.md")
        placed = "".join(page.read_text(encoding="utf-8") for page in pages)
        for name in halfshell.__all__:
            if f":: {name}\n" not in placed:
                kind = "class" if isinstance(getattr(halfshell, name), type) else "function"
                source[0] = source[0].rstrip().removesuffix("```")
                source[0] += f"\n.. auto{kind}:: halfshell.{name}\n```\n"


def setup(app):
    app.connect("source-read", place_new_names)
    app.connect("autodoc-process-docstring", link_public_names)
    app.connect("autodoc-process-signature", leave_out_signature)
