# SPDX-License-Identifier: BSD-3-Clause
"""Measures an episode from what was recorded of it."""
