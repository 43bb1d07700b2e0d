# SPDX-License-Identifier: BSD-3-Clause
"""What a planner is asked, what it may use and what it answers."""
