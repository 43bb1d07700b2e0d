# SPDX-License-Identifier: BSD-3-Clause
"""Initializes the ROS node, under the names of MoveIt's roscpp binding."""

from __future__ import annotations

from collections.abc import Sequence

from moveit_commander import roscpp_initializer


def roscpp_init(node_name: str, argv: Sequence[str]) -> None:
    """Stores node name and command line; the first interface initializes the node, unless the script has done so."""
    roscpp_initializer.roscpp_initialize(argv, node_name)


def roscpp_shutdown() -> None:
    """Closes the connections of the interfaces; shuts the node down only if an interface has initialized it."""
    roscpp_initializer.roscpp_shutdown()
