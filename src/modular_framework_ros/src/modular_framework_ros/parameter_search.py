# SPDX-License-Identifier: BSD-3-Clause
"""Finds a parameter that is given to one node or shared by several, such as the robot's description."""

from __future__ import annotations

import rospy


def nearest_parameter(name: str) -> str:
    """Returns the absolute name of a parameter: in the node's private namespace, or else in the nearest one above it.

    Args:
        name: relative name, which may be remapped; one that begins with / or ~ is taken as it is.

    Returns:
        The name; where there is no such parameter, the one the node's namespace gives it.
    """
    found = None if name.startswith("~") else rospy.search_param(name)
    return str(rospy.resolve_name(found or name))
