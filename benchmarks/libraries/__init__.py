# SPDX-License-Identifier: BSD-3-Clause
"""The libraries that take part, ours too, as the runner wants them; and whether answers agree."""
