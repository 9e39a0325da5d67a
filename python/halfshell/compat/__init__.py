# SPDX-License-Identifier: BSD-3-Clause
"""Drop-ins for functions and classes of other libraries, with the same names and rules.

A module for each library, which must be installed. None of them is imported with ``halfshell``:
write ``from halfshell.compat.ase import neighbor_list``. See ``docs/drop-ins.md``.
"""
