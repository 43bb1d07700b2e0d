#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Loads and starts the controllers of a robot: ROBOT_PACKAGE CONTROLLER_FILE."""

from modular_framework_ros.node_start import run_node

if __name__ == "__main__":
    run_node("modular_framework_core.launching.ros_robot_controllers_spawner")
