# SPDX-License-Identifier: BSD-3-Clause
"""Grasps and releases: approach, fingers, retreat."""
