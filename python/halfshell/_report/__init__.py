# SPDX-License-Identifier: BSD-3-Clause
"""Error against run time: `measure` runs, `truth` and `physics` judge, `page` shows."""
