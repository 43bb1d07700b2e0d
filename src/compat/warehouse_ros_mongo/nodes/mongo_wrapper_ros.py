#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Replaces the MongoDB server that `db:=true` of MoveIt's launch files starts; the error names the alternatives."""

import sys

from modular_framework_ros.ros_missing_program import refuse

if __name__ == "__main__":
    sys.exit(
        refuse(
            "warehouse_ros_mongo/mongo_wrapper_ros.py",
            "db:=true",
            "leave db at false; scenes are kept in .scene files (moveit_export_scene_to_text), constraints in an "
            "SQLite file (ConstraintsStorage of moveit_commander)",
        )
    )
