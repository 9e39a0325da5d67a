# SPDX-License-Identifier: BSD-3-Clause
"""Drop-ins for functions and classes of other libraries, with the same names and rules.

A module for each library, which must be installed. None of them is imported with ``halfshell``:
write ``from halfshell.compat.ase import neighbor_list``. See ``docs/drop-ins.md``.
"""

import importlib
from types import ModuleType

_MODULES = ("ase", "matscipy", "mdanalysis", "pymatgen", "scipy", "sklearn")


def __getattr__(name: str) -> ModuleType:
    if name in _MODULES:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(
        f"module {__name__!r} has no attribute {name!r}: each library has a module, "
        + ", ".join(_MODULES)
    )
