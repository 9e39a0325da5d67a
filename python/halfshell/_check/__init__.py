# SPDX-License-Identifier: BSD-3-Clause
"""What answers are checked by: rational arithmetic, and lists of other libraries."""
