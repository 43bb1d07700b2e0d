# SPDX-License-Identifier: BSD-3-Clause
"""The modules of MoveIt's Python bindings under their public names; moveit_commander does the work."""
