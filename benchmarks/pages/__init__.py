# SPDX-License-Identifier: BSD-3-Clause
"""What is made of times: ratios, tables, result files, and the sections of a page."""
