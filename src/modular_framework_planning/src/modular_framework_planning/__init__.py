# SPDX-License-Identifier: BSD-3-Clause
"""The move_group node: planning scene, kinematics, planning and execution, under the names of MoveIt."""
