# SPDX-License-Identifier: BSD-3-Clause
"""What a process does before it plans: compiled loops and settings of its threads."""
