# SPDX-License-Identifier: BSD-3-Clause
"""Stands where launch files of other stacks start a program that is not here: it says so, and what to do instead."""

from __future__ import annotations

import rospy


def refuse(program: str, option: str, instead: str) -> int:
    """Says in the log and on the terminal that a program is not there.

    Args:
        program: package and name, as launch files give them.
        option: of a public launch file that asks for it.
        instead: what serves the purpose here.

    Returns:
        The exit code of the node, 1.
    """
    rospy.init_node(program.partition("/")[2].partition(".")[0], anonymous=True)
    rospy.logfatal("%s, asked for by %s, is refused: there is no such program here; %s", program, option, instead)
    return 1
