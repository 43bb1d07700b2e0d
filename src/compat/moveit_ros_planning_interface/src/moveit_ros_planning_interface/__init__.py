# SPDX-License-Identifier: BSD-3-Clause
"""Modules of MoveIt's Python bindings under their public names, implemented by moveit_commander."""
