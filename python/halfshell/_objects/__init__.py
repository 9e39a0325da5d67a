# SPDX-License-Identifier: BSD-3-Clause
"""Public classes: boxes, cell lists, neighbour tables, Verlet lists."""
