#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Commands move_group from a terminal: ``rosrun moveit_commander moveit_commander_cmdline.py [GROUP]``."""

import sys

from moveit_commander.command_line import main

if __name__ == "__main__":
    sys.exit(main())
