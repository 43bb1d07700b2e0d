#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Spawns or deletes an object of the simulation."""

import sys

from modular_framework_core.scene.ros_manage_object import main

if __name__ == "__main__":
    sys.exit(main())
