# SPDX-License-Identifier: BSD-3-Clause
"""How Sphinx builds the site: `python -m sphinx -W --keep-going docs build/site`."""

import re
from pathlib import Path

import halfshell

project = "halfshell"
author = "The halfshell developers"
project_copyright = author
version = release = halfshell.__version__

extensions = ["sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc", "myst_nb"]
source_suffix = {".rst": "restructuredtext", ".md": "myst-nb"}  # the first is that of stubs
exclude_patterns = ["_build", "report/*.html", "templates"]
root_doc = "index"
nitpicky = True

html_theme = "furo"
html_title = "halfshell"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sphinx = False
templates_path = ["templates"]

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
# A page for each name in the tables of reference/index.md, in reference/api. Where case does not
# tell files apart, `Clusters` and `clusters` need different names.
autosummary_generate = True
autosummary_filename_map = {
    f"halfshell.{name}": f"halfshell.{name}-class"
    for name in halfshell.__all__
    if name.lower() != name
}
numpydoc_show_class_members = False
numpydoc_xref_param_type = False


def leave_out_signature(app, what, name, _obj, _options, signature, returned):
    """Return no signature for classes that users do not call, but get; else what users may give."""
    page = Path(app.srcdir, "reference", "index.md").read_text(encoding="utf-8")
    results = page.partition("## Results")[2].partition("##")[0]
    if what == "class" and name.rpartition(".")[2] in results.split():
        return "", None
    shown = re.sub(r", \*\*unknown\b[^,)]*", "", signature or "")
    return re.sub(r"<class '([\w.]+)'>", r"\1", shown) or signature, returned


def link_public_names(_app, _what, _name, _obj, _options, lines):
    """Make `pairs` in a docstring a link, and leave `points` as it is."""
    names = "|".join(halfshell.__all__)
    for k, line in enumerate(lines):
        lines[k] = re.sub(rf"(?<![`:])`({names})`(?!`)", r":py:obj:`~halfshell.\1`", line)


def setup(app):
    app.connect("autodoc-process-docstring", link_public_names)
    app.connect("autodoc-process-signature", leave_out_signature)
