# SPDX-License-Identifier: BSD-3-Clause
"""Functions that create messages, under the module name used by nodes of the original framework."""

from modular_framework_core.grasping.grasp_messages import (
    generate_joint_state_message,
    generate_pose_stamped_message,
    get_standardised_grasp,
)

__all__ = ["generate_joint_state_message", "generate_pose_stamped_message", "get_standardised_grasp"]
