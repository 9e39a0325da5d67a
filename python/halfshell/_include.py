# SPDX-License-Identifier: BSD-3-Clause
"""Where the C headers are."""

from pathlib import Path

HEADER = "halfshell.h"


def get_include() -> str:
    """Return the directory of the C headers, for ``include_dirs`` or ``-I``.

    `halfshell.h` declares the C interface of the core, for programs that compile the core
    themselves. `halfshell_capi.h` has the same functions as a table that an extension module asks
    this package for, and links nothing.

    Returns
    -------
    str
        An absolute path. In an installed package the headers lie in it, in an editable one in the
        checkout.

    Raises
    ------
    FileNotFoundError
        If they were not installed.

    Examples
    --------
    >>> import os
    >>> import halfshell as hs
    >>> sorted(name for name in os.listdir(hs.get_include()) if name.startswith("halfshell"))
    ['halfshell.h', 'halfshell_capi.h', 'halfshell_dynamic.h', 'halfshell_nodes.h']
    """
    package = Path(__file__).resolve().parent
    installed, checkout = package / "include", package.parents[1] / "csrc"
    for folder in (installed, checkout):
        if (folder / HEADER).is_file():
            return str(folder)
    raise FileNotFoundError(f"{HEADER} is missing from {installed}: install halfshell again")
