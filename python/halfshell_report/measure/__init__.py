# SPDX-License-Identifier: BSD-3-Clause
"""Runs of all methods on all scenes, timed."""
