# SPDX-License-Identifier: BSD-3-Clause
"""A small config package without a fault, which tests break by one edit each."""

from __future__ import annotations

from pathlib import Path

from modular_framework_core.files.faults import Fault
from modular_framework_setup.checks.package_check import check_package

JOINTS = ("pan", "lift", "elbow")
URDF = """<?xml version="1.0"?>
<robot name="crane">
  <link name="base"/>
  <link name="turret"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="boom"><collision><geometry><mesh filename="package://crane_robot/meshes/boom.stl"/></geometry></collision></link>
  <link name="stick"/>
  <link name="palm"/>
  <link name="finger_1"/>
  <link name="finger_2"/>
  <joint name="pan" type="revolute"><parent link="base"/><child link="turret"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="10" velocity="2"/></joint>
  <joint name="lift" type="revolute"><parent link="turret"/><child link="boom"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="10" velocity="2"/></joint>
  <joint name="elbow" type="revolute"><parent link="boom"/><child link="stick"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="10" velocity="2"/></joint>
  <joint name="hand" type="fixed"><parent link="stick"/><child link="palm"/></joint>
  <joint name="grip_1" type="prismatic"><parent link="palm"/><child link="finger_1"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" effort="10" velocity="0.2"/></joint>
  <joint name="grip_2" type="prismatic"><parent link="palm"/><child link="finger_2"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.04" effort="10" velocity="0.2"/><mimic joint="grip_1"/></joint>
</robot>
"""
SRDF = """<?xml version="1.0"?>
<robot name="crane">
  <group name="arm"><chain base_link="base" tip_link="palm"/></group>
  <group name="gripper">
    <joint name="grip_1"/>
    <joint name="grip_2"/>
  </group>
  <group_state name="home" group="arm">
    <joint name="pan" value="0"/>
    <joint name="lift" value="0.5"/>
    <joint name="elbow" value="1"/>
  </group_state>
  <group_state name="open" group="gripper"><joint name="grip_1" value="0.04"/></group_state>
  <end_effector name="claw" parent_link="palm" parent_group="arm" group="gripper"/>
  <virtual_joint name="fixed_base" type="fixed" parent_frame="world" child_link="base"/>
  <passive_joint name="grip_2"/>
  <disable_collisions link1="base" link2="turret" reason="Adjacent"/>
  <disable_collisions link1="turret" link2="boom" reason="Never"/>
</robot>
"""
JOINT_LIMITS = """default_velocity_scaling_factor: 0.5
joint_limits:
  pan:
    has_velocity_limits: true
    max_velocity: 1.5
  lift:
    has_velocity_limits: yes
    max_velocity: 1.5
    has_acceleration_limits: false
    max_acceleration: 0
"""
KINEMATICS = """arm:
  kinematics_solver: kdl_kinematics_plugin/KDLKinematicsPlugin
  kinematics_solver_timeout: 0.05
"""
MOVEIT_CONTROLLERS = """controller_list:
  - name: arm_controller
    action_ns: follow_joint_trajectory
    type: FollowJointTrajectory
    default: true
    joints: [pan, lift, elbow]
  - name: gripper_controller
    action_ns: gripper_cmd
    type: GripperCommand
    default: true
    joints:
      - grip_1
"""
HARDWARE_CONTROLLERS = """joint_state_controller:
  type: joint_state_controller/JointStateController
arm_controller:
  type: position_controllers/JointTrajectoryController
  joints:
    - pan
    - lift
    - elbow
gripper_controller:
  type: position_controllers/GripperActionController
  joint: grip_1
"""
OMPL = """planner_configs:
  RRTConnect:
    type: geometric::RRTConnect
arm:
  default_planner_config: RRTConnect
  planner_configs:
    - RRTConnect
  projection_evaluator: joints(pan,lift)
"""
SENSORS = """sensors:
  - sensor_plugin: occupancy_map_monitor/PointCloudOctomapUpdater
    point_cloud_topic: /camera/points
"""
LAUNCH = """<launch>
  <rosparam command="load" file="$(find crane_moveit_config)/config/kinematics.yaml"/>
</launch>
"""
SETTINGS = """moveit_setup_assistant_config:
  URDF:
    package: crane_robot
    relative_path: urdf/crane.urdf
  SRDF:
    relative_path: config/crane.srdf
"""


class SmallPackage:
    """The two packages of the crane, side by side in a folder; nothing of them is built.

    Attributes:
        folder: of the config package.
    """

    def __init__(self, root: Path) -> None:
        self.folder = root / "crane_moveit_config"
        self._write("../crane_robot/package.xml", "<package><name>crane_robot</name></package>")
        self._write("../crane_robot/urdf/crane.urdf", URDF)
        self._write("../crane_robot/meshes/boom.stl", "solid boom\nendsolid\n")
        self._write("package.xml", "<package><name>crane_moveit_config</name></package>")
        self._write(".setup_assistant", SETTINGS)
        self._write("config/crane.srdf", SRDF)
        self._write("config/joint_limits.yaml", JOINT_LIMITS)
        self._write("config/kinematics.yaml", KINEMATICS)
        self._write("config/simple_moveit_controllers.yaml", MOVEIT_CONTROLLERS)
        self._write("config/ros_controllers.yaml", HARDWARE_CONTROLLERS)
        self._write("config/ompl_planning.yaml", OMPL)
        self._write("config/sensors_3d.yaml", SENSORS)
        self._write("launch/move_group.launch", LAUNCH)

    def _write(self, name: str, text: str) -> None:
        path = self.path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def path(self, name: str) -> Path:
        """Returns a file; `urdf` is the robot description, other names are relative to the config package."""
        return self.folder / ("../crane_robot/urdf/crane.urdf" if name == "urdf" else name)

    def edit(self, name: str, old: str, new: str) -> int:
        """Replaces a text that is there once; returns the line where it was."""
        path = self.path(name)
        text = path.read_text()
        assert text.count(old) == 1, f"{old!r} is {text.count(old)} times in {name}"
        path.write_text(text.replace(old, new))
        return text[: text.index(old)].count("\n") + 1

    def faults(self) -> tuple[Fault, ...]:
        """Checks it."""
        return check_package(self.folder)
