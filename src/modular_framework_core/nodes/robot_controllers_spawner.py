#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Loads and starts the controllers of a robot: ROBOT_PACKAGE CONTROLLER_FILE."""
import sys

from modular_framework_core.ros_robot_controllers_spawner import main

sys.exit(main())
