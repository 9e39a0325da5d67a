# SPDX-License-Identifier: BSD-3-Clause
"""Error against run time: scenes, methods, truth, errors, tables, figures, words."""
