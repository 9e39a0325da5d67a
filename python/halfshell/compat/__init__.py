# SPDX-License-Identifier: BSD-3-Clause
"""Stand-ins for functions of other libraries, with their names, conventions and errors.

Each module is imported by its name, `halfshell.compat.ase` for one, and needs the library that it
stands in for. See ``docs/drop-ins.md``.
"""
