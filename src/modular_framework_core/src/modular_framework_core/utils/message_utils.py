# SPDX-License-Identifier: BSD-3-Clause
"""The functions that make messages, under the module name nodes of the original framework import them from."""

from modular_framework_core.grasping.grasp_messages import (
    generate_joint_state_message,
    generate_pose_stamped_message,
    get_standardised_grasp,
)

__all__ = ["generate_joint_state_message", "generate_pose_stamped_message", "get_standardised_grasp"]
