# SPDX-License-Identifier: BSD-3-Clause
"""One scene at a time: calls that take turns, and what their times depend on."""
