# SPDX-License-Identifier: BSD-3-Clause
"""Set-up of a process before it plans: compiled loops and settings of its threads."""
