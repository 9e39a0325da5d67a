# SPDX-License-Identifier: BSD-3-Clause
"""The true pairs, by integers, and the errors of a list against them."""
