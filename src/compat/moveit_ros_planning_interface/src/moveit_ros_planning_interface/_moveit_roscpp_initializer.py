# SPDX-License-Identifier: BSD-3-Clause
"""Makes the process a ROS node, under the names of MoveIt's binding of roscpp."""

from __future__ import annotations

from collections.abc import Sequence

from moveit_commander import roscpp_initializer


def roscpp_init(node_name: str, argv: Sequence[str]) -> None:
    """Keeps the name and the command line for the node, which the first interface makes unless the script has one."""
    roscpp_initializer.roscpp_initialize(argv, node_name)


def roscpp_shutdown() -> None:
    """Closes the connections of the interfaces; ends the node only if they have made it."""
    roscpp_initializer.roscpp_shutdown()
