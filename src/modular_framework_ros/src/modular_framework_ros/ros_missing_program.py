# SPDX-License-Identifier: BSD-3-Clause
"""Stands in for programs of other stacks that do not exist here: logs the reason and an alternative."""

from __future__ import annotations

import rospy


def refuse(program: str, option: str, instead: str) -> int:
    """Logs that a program does not exist.

    Args:
        program: Package and name of the program, as in launch files.
        option: Option of a public launch file that starts the program.
        instead: Alternative in this framework.

    Returns:
        The exit code of the node, 1.
    """
    rospy.init_node(program.partition("/")[2].partition(".")[0], anonymous=True)
    rospy.logfatal(
        "%s, requested by %s, is refused: this framework does not have the program; %s", program, option, instead
    )
    return 1
