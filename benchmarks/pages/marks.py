# SPDX-License-Identifier: BSD-3-Clause
"""Sections of a page that are made from result files.

A section stands between ``<!-- begin: NAME -->`` and ``<!-- end: NAME -->``. One for which no
figures are given says so, so that a page never shows figures of another version.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

__all__ = ["EMPTY", "Lines", "fill", "table"]

EMPTY = "Not measured for this version yet."

Lines = list[str]


def table(head: Sequence[str], body: Sequence[Sequence[str]]) -> Lines:
    """Lay out a table in Markdown, nothing where there are no rows."""
    if not body:
        return []
    rule = ["---"] * len(head)
    return [f"| {' | '.join(row)} |" for row in (head, rule, *body)]


def fill(page: str, sections: Mapping[str, Sequence[str]]) -> str:
    """Put lines between the marks of each section. Raises ValueError for a missing mark."""
    for name, lines in sections.items():
        begin, end = f"<!-- begin: {name} -->", f"<!-- end: {name} -->"
        head, found, rest = page.partition(begin)
        tail = rest.partition(end)[2]
        if not found or end not in rest:
            raise ValueError(f"no marks of the section {name}")
        body = "\n".join(lines) or EMPTY
        page = f"{head}{begin}\n{body}\n{end}{tail}"
    return page
