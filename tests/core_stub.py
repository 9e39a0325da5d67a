# SPDX-License-Identifier: BSD-3-Clause
"""The part of python/halfshell/_core.pyi that says what searches take, from the table of the
interface (csrc/binding/interface.c).

    python tests/core_stub.py            compare
    python tests/core_stub.py --write    after the table was changed
"""

from __future__ import annotations

import sys
from pathlib import Path

from halfshell import _core

STUB = Path(__file__).resolve().parents[1] / "python/halfshell/_core.pyi"
N_SHARED, LINE = 10, 100  # arguments of every search; characters
BEGIN, END = "# ---- written by tests/core_stub.py\n", "# ---- end of what is written\n"

#: What each argument is, beyond those of every search; one name means one thing in all functions.
#: Others are `Any`.
TYPES = {
    "quantities": "str", "sort": "bool", "index_dtype": "int", "k": "int", "edges": "_Floats",
    "last_inclusive": "bool", "n_types": "int", "core": "npt.NDArray[np.bool_] | None",
    "winding": "bool", "max_pairs": "int", "user_data": "int", "thread_safe": "bool",
    "first": "int", "measure": "bool", "cell_size": "float", "domain": "_Floats | None",
    "skin": "float", "rebuild": "bool",
}  # fmt: skip

#: What they return; others: an array or several.
RETURNS = {
    "count_pairs": "int | _Ints", "neighbors": "tuple[_Array, ...]", "coordination": "_Ints",
    "iter_pairs": "Any", "for_each_pair": "int", "histogram": "_Array",
    "clusters": "tuple[int, _Ints, npt.NDArray[np.uint8] | None]", "explain": "dict[str, Any]",
    "cells_build": "Any", "cells_find": "_Ints", "cells_candidates": "tuple[_Ints, ...]",
    "verlet_update": "bool",
} | dict.fromkeys(
    ("connect", "connect_search", "overlap", "intersect", "pair_rows", "keep_rows",
     "rows_without"), "Any",
)  # fmt: skip


def signature(name: str, arguments: list[tuple[str, bool]]) -> str:
    """One function: the arguments of every search, its own, and those that may be left out."""
    own = arguments[N_SHARED:]
    while own and own[-1][1]:
        own = own[:-1]
    rest = ["*_Rest"] if arguments[-1][1] else []
    takes = ", ".join(["*_Search", *(TYPES.get(one, "Any") for one, _ in own), *rest])
    text = f"def {name}(*arguments: *tuple[{takes}]) -> {RETURNS.get(name, '_Arrays')}: ..."
    if len(text) > LINE:
        text = text.replace("(*arg", "(\n    *arg").replace(") ->", ",\n) ->")
    return text + "\n"


def written() -> str:
    """The functions of the table, in its order."""
    return "".join(signature(name, core) for name, core in _core.table().items())


def expected() -> str:
    """The whole stub, as it should be."""
    head, _, rest = STUB.read_text().partition(BEGIN)
    return head + BEGIN + written() + "\n" + END + rest.partition(END)[2]


if __name__ == "__main__":
    if "--write" in sys.argv[1:]:
        STUB.write_text(expected())
    elif STUB.read_text() != expected():
        sys.exit("_core.pyi is not what the table says: python tests/core_stub.py --write")
