# SPDX-License-Identifier: BSD-3-Clause
"""``python -m halfshell``: the command line."""

import sys

from halfshell.cli import main

sys.exit(main())
