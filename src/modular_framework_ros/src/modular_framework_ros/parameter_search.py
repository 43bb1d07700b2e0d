# SPDX-License-Identifier: BSD-3-Clause
"""Finds a parameter, such as the robot description, in the namespaces of a node."""

from __future__ import annotations

import rospy


def nearest_parameter(name: str) -> str:
    """Returns the absolute name of a parameter in the node's private namespace or in the nearest namespace above.

    Args:
        name: Relative name, after remapping; a name that begins with / or ~ is not searched.

    Returns:
        The name of the parameter found; otherwise the name resolved in the node's namespace.
    """
    found = None if name.startswith("~") else rospy.search_param(name)
    return str(rospy.resolve_name(found or name))
