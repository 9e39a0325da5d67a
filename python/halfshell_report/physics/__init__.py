# SPDX-License-Identifier: BSD-3-Clause
"""What wrong pairs do to forces and to the energy of a trajectory."""
