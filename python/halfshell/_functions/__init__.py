# SPDX-License-Identifier: BSD-3-Clause
"""Public functions: signatures, arguments and documentation; the work is done in C."""
