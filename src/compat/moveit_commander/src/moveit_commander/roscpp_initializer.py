# SPDX-License-Identifier: BSD-3-Clause
"""Initialises a ROS node for scripts without their own, with MoveIt's function names."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import rospy

NODE_NAME = "move_group_commander_wrappers"


class _Node:
    """Resources that this library created: the node, if any, and connections to close."""

    def __init__(self) -> None:
        self._name = NODE_NAME
        self._arguments: list[str] | None = None
        self._ours = False
        self._closers: list[Callable[[], None]] = []

    def remember(self, arguments: Sequence[str], name: str) -> None:
        self._name = name
        self._arguments = [argument for argument in arguments if not argument.startswith("__name:=")]

    def ensure(self) -> None:
        """Initialises a node unless the script has done so."""
        if not rospy.core.is_initialized():
            rospy.init_node(self._name, argv=self._arguments, anonymous=True, disable_signals=True)
            self._ours = True

    def on_shutdown(self, close: Callable[[], None]) -> None:
        self._closers.append(close)

    def close(self) -> None:
        while self._closers:
            self._closers.pop()()
        if self._ours and not rospy.is_shutdown():
            rospy.signal_shutdown("roscpp_shutdown was called")


_node = _Node()
ensure_node = _node.ensure
on_shutdown = _node.on_shutdown


def roscpp_initialize(args: Sequence[str], node_name: str = NODE_NAME) -> None:
    """Stores the command line and a name for the node; a script may call rospy.init_node before or after.

    The first interface creates the node unless the script has called rospy.init_node by then.
    """
    _node.remember(args, node_name)


def roscpp_shutdown() -> None:
    """Closes the connections of this library and a node that it created; repeated calls are allowed."""
    _node.close()
