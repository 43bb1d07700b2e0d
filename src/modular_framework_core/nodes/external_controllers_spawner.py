#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Starter of the manipulator's own node."""
import sys

from modular_framework_core.ros_external_controllers import main

if __name__ == "__main__":
    sys.exit(main())
