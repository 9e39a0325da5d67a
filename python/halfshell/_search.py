# SPDX-License-Identifier: BSD-3-Clause
"""The decorators of searches.

`search` lets C answer plain calls at once, and says of an unknown keyword which one may be meant.
`document` puts the descriptions of shared arguments into docstrings.
"""

from __future__ import annotations

from functools import wraps
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Any, TypeVar, cast

from halfshell import _core
from halfshell._errors import REFUSALS, shorten

if TYPE_CHECKING:
    from collections.abc import Callable

Function = TypeVar("Function", bound="Callable[..., Any]")

_CUTOFF = """
    cutoff : float, array_like of float, shape (k,), (s,) or (t, t), dict or None
        Largest distance of a pair, in the unit of `points`; not negative; it may be larger than the
        box, and infinite where no axis is periodic. One for each system of a batch, shape (s,). By
        type: a dict such as ``{("H", "O"): 1.2, ("*", "*"): 2.0}``, in which a key with fewer stars
        wins and two types without a key form no pairs, or a symmetric table with a row for each
        type. With radii a further limit, or left out. With supports the extent, finite: ``|H @
        D| <= cutoff``. Of a `CellList` its own, if it is left out.
    """

#: Descriptions of arguments that mean the same everywhere, and of what functions that draw return.
SHARED = {
    "points": """
    points : array_like of float, shape (n, d), or Points
        Coordinates, any length unit, 1 <= d <= 8; or `Points`, or an object of another library,
        which bring what they know: box, periodicity, types, radii, ... Several systems are a
        list of these.
    """,
    "cutoff": _CUTOFF,
    "shells": f"""{_CUTOFF.rstrip()}
        Several ascending ones, shape (k,), go with the letter ``k``.
    """,
    "queries": """
    queries : array_like of float, shape (q, d), or Points, optional
        Where neighbours are looked for, in place of at each of the points. Nothing is left out
        then: a point at the place of a query is a neighbour at distance 0.
    """,
    "box": """
    box : float, array_like of float, shape (d,) or (d, d), or Box, optional
        One length for all edges, a length for each, or edge vectors as rows, in the unit of
        `points`; finite. None: open space, or the box that `points` bring. Rows of axes that are
        not periodic may be anything finite, such as zero.
    """,
    "periodic": """
    periodic : bool or sequence of bool, shape (d,), optional
        Which box vectors are periodic. Default: all with a box, none without.
    """,
    "rule": """
    rule : {"sum", "mean", "max", "min", "gather", "scatter"}, optional
        How the two radii of a pair make its cutoff: their sum (default), half of it, the larger or
        the smaller one; in rows and with queries also "gather", that of the query, or point i, and
        "scatter", that of j. With supports, "max" (default) means within either, "min" within both.
    """,
    "exclude": """
    exclude : array_like of int, shape (k, 2), or int, optional
        Pairs that do not count, in their nearest image, which is decided exactly: numbers of two
        points, or of a query and a point, such as `bonded` gives; or a whole number w: pairs whose
        `labels` differ by at most w, 0 for equal ones.
    """,
    "min_distance": """
    min_distance : float, optional
        Pairs that are nearer do not count; finite, not negative.
    """,
    "indices": """
    indices : array_like of int, shape (r,), optional
        Only these points: their rows, in this order, or the pairs that have at least one of them.
        The time that it takes depends on their number.
    """,
    "inclusive": """
    inclusive : bool, default True
        Whether a pair at exactly its cutoff counts.
    """,
    "index_dtype": """
    index_dtype : numpy.int64 or numpy.int32, default numpy.int64
        Type of numbers of points.
    """,
    "threads": """
    threads : int, optional
        Maximum number of threads. Default: one for small scenes, otherwise ``OMP_NUM_THREADS``, or
        the number of cores that this process may run on. The result is the same for any number.
    """,
    "progress": """
    progress : bool or callable, optional
        True: show a bar in a long search. A function is called now and then as
        ``progress(fraction)``, from 0 to 1, never falling; an exception ends the search.
    """,
    "ax": """
    ax : matplotlib.axes.Axes, optional
        Axes to draw on; for points in three dimensions with ``projection="3d"``. Default: axes of
        a new figure.
    """,
    "unit": """
    unit : str, optional
        The unit of lengths, for the labels of the axes: "Å".
    """,
    "drawn": """
    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.

    Raises
    ------
    ImportError
        If matplotlib is not installed: ``pip install matplotlib``.
    """,
}


#: Keywords that searches share, in their order, with their types; None where they are left out.
_KEYWORDS = {
    "box": "BoxLike | None",
    "periodic": "PeriodicLike | None",
    "rule": "Rule | None",
    "exclude": "ArrayLike | int | None",
    "min_distance": "float | None",
    "indices": "npt.ArrayLike | None",
    "inclusive": "bool",
    "threads": "int | None",
    "progress": "ProgressLike",
}


def search(
    name: str = "", *, finish: Callable[..., Any] | None = None, lacks: str = ""
) -> Callable[[Function], Function]:
    """Decorate a search: a function of points, cutoff and keywords.

    name: what the table in C calls it (csrc/binding/interface.c). C is tried first, and answers a
    call if it can convert all arguments (csrc/binding/arguments.c); otherwise the function itself
    does. finish: makes the result from what C returned and the arguments. lacks: which of the
    shared keywords a function does not take that has ``**search``, in place of which they are.
    """

    def decorate(function: Function) -> Function:
        document(function)
        code = function.__code__
        own = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        takes = "search" in code.co_varnames[len(own) : len(own) + 1]
        shared = [one for one in _KEYWORDS if takes and one not in lacks.split()]
        defaults = {one: True if one == "inclusive" else None for one in shared}
        known = (*own, *shared)
        attempt = None
        if name:
            positional = own[: code.co_argcount]
            usual = dict(zip(positional[::-1], (function.__defaults__ or ())[::-1], strict=False))
            usual |= {**(function.__kwdefaults__ or {}), **defaults}
            attempt = _core.quick(name, known, code.co_argcount, usual)

        @wraps(function)
        def call(*arguments: Any, **options: Any) -> Any:
            if attempt is not None:
                result = attempt(arguments, options)
                if result is not NotImplemented:
                    return result if finish is None else finish(result, *arguments, **options)
            if not options.keys() <= names:
                from halfshell._unknown import refuse_unknown

                refuse_unknown(call, [name for name in options if name not in names])
            if len(arguments) > code.co_argcount:
                from halfshell._unknown import refuse_count

                refuse_count(function, len(arguments), code.co_argcount)
            try:
                return function(*arguments, **options)
            except REFUSALS as error:
                shorten(error)
                raise

        names = frozenset(known)
        if shared:
            kind = Parameter.KEYWORD_ONLY
            spell_out(call, [
                Parameter(one, kind, default=defaults[one], annotation=_KEYWORDS[one])
                for one in shared
            ])  # fmt: skip
        return cast("Function", call)

    return decorate


def spell_out(function: Callable[..., Any], keywords: list[Parameter]) -> None:
    """Put the keywords that a function takes as its last argument, with ``**``, into its signature.

    They come behind `queries` and before the function's own; threads and progress come last.
    """
    known = signature(function)
    places = dict.fromkeys((one.name for one in keywords), 1)
    places |= {"max_distance": 0, "queries": 0, "threads": 3, "progress": 3}
    both = [*known.parameters.values()][:-1] + keywords
    both.sort(key=lambda one: (one.kind, one.kind == one.KEYWORD_ONLY and places.get(one.name, 2)))
    cast("Any", function).__signature__ = known.replace(parameters=both)


def document(function: Function, **changed: str) -> Function:
    """Put the descriptions of shared arguments in place of their names in braces in a docstring.

    changed: other descriptions for some of them.
    """
    if not function.__doc__:
        return function
    texts = {**SHARED, **changed}
    lines = []
    for line in function.__doc__.split("\n"):
        stripped = line.strip()
        names = stripped[1:-1].split(", ")
        if stripped[:1] != "{" or stripped[-1:] != "}" or names[0] not in texts:
            lines.append(line)
            continue
        margin = line[: len(line) - len(line.lstrip())]
        for name in names:
            text = texts[name].strip("\n").rstrip()
            lines += [(margin + one[4:]).rstrip() for one in text.split("\n")]
    function.__doc__ = "\n".join(lines)
    return function
