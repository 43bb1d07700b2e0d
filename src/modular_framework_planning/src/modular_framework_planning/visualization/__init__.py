# SPDX-License-Identifier: BSD-3-Clause
"""Drag a goal in RViz, plan and execute."""
