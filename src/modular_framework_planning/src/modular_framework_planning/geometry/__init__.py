# SPDX-License-Identifier: BSD-3-Clause
"""Poses, collision shapes and region solids."""
