# SPDX-License-Identifier: BSD-3-Clause
"""What users pass, brought to the forms that the core takes."""
