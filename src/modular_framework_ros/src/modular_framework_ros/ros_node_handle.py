# SPDX-License-Identifier: BSD-3-Clause
"""A node handle that reads the ROS parameter server."""

from __future__ import annotations

from typing import Any

import rospy

from modular_framework_ros.node_handle import join_names


class RosNodeHandle:
    """Read access to the parameters below a namespace of the parameter server.

    Args:
        namespace: Absolute name, or "~" for the node's private namespace.
    """

    def __init__(self, namespace: str = "/") -> None:
        self._namespace = join_names(rospy.get_name() if namespace == "~" else namespace, "")

    @property
    def namespace(self) -> str:
        return self._namespace

    def has_param(self, key: str) -> bool:
        return bool(rospy.has_param(join_names(self._namespace, key)))

    def get_param(self, key: str, default: Any = None) -> Any:
        return rospy.get_param(join_names(self._namespace, key), default)

    def child(self, name: str) -> RosNodeHandle:
        return RosNodeHandle(join_names(self._namespace, name))
