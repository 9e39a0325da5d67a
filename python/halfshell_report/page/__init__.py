# SPDX-License-Identifier: BSD-3-Clause
"""Rows of figures as CSV, tables, pictures, sentences and a page."""
