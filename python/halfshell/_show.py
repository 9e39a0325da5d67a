# SPDX-License-Identifier: BSD-3-Clause
"""How objects show themselves: in one line as text, in a small table in a notebook.

A class takes ``__repr__ = _show.line`` and ``_repr_html_ = _show.html`` into its body; named tuples
are decorated by `shown`. What is shown are the attributes that `_shown` names, or else the
fields, but not what is None or empty. Of arrays with more than a few numbers it is type and shape.
Nothing is computed for it, and no colour is set: a notebook's own are used.
"""

from __future__ import annotations

from operator import attrgetter
from typing import Any

import numpy as np

_WIDTH = 60  # characters of one value
_FEW = 9  # numbers of a tuple, or of an array, that are written out


def line(value: Any) -> str:
    """``Name(what=..., ...)``, on one line."""
    told = ", ".join(f"{name}={text}" for name, text in facts(value))
    return f"{type(value).__name__}({told})"


def html(value: Any) -> str:
    """A table with a row for each attribute; the repr of what names none."""
    from html import escape

    if not (told := facts(value)):
        return f"<code>{escape(repr(value))}</code>"
    rows = "".join(
        f'<tr><th style="text-align: left">{escape(name)}</th>'
        f'<td style="text-align: left">{escape(text)}</td></tr>'
        for name, text in told
    )
    return (
        '<table><thead><tr><th colspan="2" style="text-align: left">'
        f"{escape(type(value).__name__)}</th></tr></thead><tbody>{rows}</tbody></table>"
    )


def shown(kind: Any) -> Any:
    """Decorate a named tuple, to show itself so."""
    kind.__repr__, kind._repr_html_ = line, html
    return kind


def attribute(path: str, doc: str | None = None) -> Any:
    """An attribute that can only be read: what the object has at this path, as "_links.pairs"."""
    return property(attrgetter(path), doc=doc)


def facts(value: Any) -> list[tuple[str, str]]:
    """The attributes to show, by name, as text; none for a class without `_shown` and fields."""
    kind = type(value)
    of_kind = ("_shown", "_fields", "__dataclass_fields__")
    names = next((list(getattr(kind, one)) for one in of_kind if hasattr(kind, one)), [])
    told = ((name, getattr(value, name)) for name in names)
    return [
        (name, _brief(each)) for name, each in told
        if each is not None and (type(each) not in (str, tuple, list, dict) or each)
    ]  # fmt: skip


def _brief(value: Any) -> str:
    """A value in a few words."""
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        return _of_array(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    if type(value) in (tuple, list):
        if len(value) > _FEW:
            return f"{len(value)} of {type(value[0]).__name__}"
        inside = ", ".join(_brief(each) for each in value)
        if type(value) is list:
            return f"[{inside}]"
        return f"({inside},)" if len(value) == 1 else f"({inside})"
    if type(value) is dict:
        return f"{len(value)} entries"
    text = " ".join(repr(value).split())
    return text if len(text) <= _WIDTH else f"{text[: _WIDTH - 3]}..."


def _of_array(array: Any) -> str:
    """Its numbers where they are few, else its type and shape; others' are not read."""
    if isinstance(array, np.generic):
        return _brief(array.item())
    if isinstance(array, np.ndarray) and 0 < array.size <= _FEW:
        text = _brief(array.tolist())
        if len(text) <= _WIDTH:
            return text
    return f"{array.dtype} {tuple(array.shape)}"
