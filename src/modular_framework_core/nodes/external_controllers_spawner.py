#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs the node that drives the manipulator."""

from modular_framework_ros.node_start import run_node

if __name__ == "__main__":
    run_node("modular_framework_core.launching.ros_external_controllers")
