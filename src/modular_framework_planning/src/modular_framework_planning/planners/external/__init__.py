# SPDX-License-Identifier: BSD-3-Clause
"""Planners in their own process and Python environment."""
