# SPDX-License-Identifier: BSD-3-Clause
"""The simulated UR5 with its controllers, and a ball to spawn, for the suites of this package."""

from __future__ import annotations

LAUNCH = """<launch>
  <arg name="physics_engine" default="pybullet"/>
  <include file="$(find ur5_ezgripper_robot)/launch/ur5_upload.launch"/>
  <include file="$(find modular_framework_simulation)/launch/simulation.launch">
    <arg name="physics_engine" value="$(arg physics_engine)"/>
    <arg name="world_file" value="$(find modular_framework_description)/worlds/ur5_setup.world"/>
    <arg name="model_path" value="$(find modular_framework_description)/models"/>
    <arg name="starting_pose" value="-J shoulder_pan_joint 1.57 -J shoulder_lift_joint -1.57 -J elbow_joint 1.57
      -J wrist_1_joint -1.57 -J wrist_2_joint -1.57"/>
  </include>
  <node name="spawner" pkg="modular_framework_core" type="robot_controllers_spawner"
        args="ur5_ezgripper_robot ur5_ezgripper_controller_simulation.yaml"/>
</launch>"""
ARM = [f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]
BALL = """<sdf version="1.6"><model name="ball"><link name="link"><inertial><mass>0.1</mass><inertia><ixx>4e-5</ixx>
  <iyy>4e-5</iyy><izz>4e-5</izz></inertia></inertial><collision name="c"><geometry><sphere><radius>0.03</radius>
  </sphere></geometry></collision></link></model></sdf>"""
