# SPDX-License-Identifier: BSD-3-Clause
"""Joint limits of a UR5 for planning, in the form of `joint_limits.yaml`."""

LIMITS = {
    name: {"has_velocity_limits": True, "max_velocity": 3.0, "has_acceleration_limits": True, "max_acceleration": 5.0}
    for name in (
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    )
}
"""Velocity [rad/s] and acceleration [rad/s^2] of each joint."""
