# SPDX-License-Identifier: BSD-3-Clause
"""The command line, ``halfshell``: ``halfshell.cli.main()`` runs it."""

import sys

from halfshell._cli.main import main

__all__ = ["main"]

if __name__ == "__main__":
    sys.exit(main())
