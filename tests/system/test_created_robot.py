# SPDX-License-Identifier: BSD-3-Clause
"""The packages that create_robot makes from a bare URDF are launched, and plan and execute motions, at once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pybullet_data

from modular_framework_testing.ros_session import RosSession

CREATE = Path(__file__).parents[2] / "src" / "modular_framework_setup" / "scripts" / "create_robot"
PANDA = Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf"
CLIENT = """
import sys
import moveit_commander, rospy
rospy.init_node("client")
arm, hand = (moveit_commander.MoveGroupCommander(name, wait_for_servers=60.0) for name in ("arm", "gripper"))
arm.set_joint_value_target([0.5, -0.3, 0.2, -1.8, 0.1, 1.6, 0.4])
assert arm.go(wait=True)
hand.set_named_target("closed")
assert hand.go(wait=True)
arm.set_named_target("ready")
assert arm.go(wait=True)
ready = arm.get_named_target_values("ready")
now = dict(zip(arm.get_active_joints(), arm.get_current_joint_values()))
assert all(abs(now[name] - value) < 1e-2 for name, value in ready.items()), (now, ready)
"""


def test_a_robot_made_from_a_bare_urdf_plans_and_moves(session: RosSession, tmp_path: Path) -> None:
    session.env["ROS_PACKAGE_PATH"] = f"{tmp_path}{os.pathsep}{session.env['ROS_PACKAGE_PATH']}"
    command = [sys.executable, str(CREATE), str(PANDA), "--into", str(tmp_path), "--samples", "250", "--yes"]
    subprocess.run(command, env=session.env, check=True, timeout=200.0)
    session.launch_package("panda_moveit_config", "demo.launch", use_rviz="false")
    session.wait_for_service("/plan_kinematic_path", 300.0)
    result = subprocess.run(
        [sys.executable, "-c", CLIENT], env=session.env, timeout=200.0, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, f"{result.stderr}\n{session.log()}"
