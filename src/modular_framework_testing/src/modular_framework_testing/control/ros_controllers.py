# SPDX-License-Identifier: BSD-3-Clause
"""Starts controllers through the services of a controller manager."""

from __future__ import annotations

from collections.abc import Sequence

import rospy
from controller_manager_msgs.srv import LoadController, SwitchController, SwitchControllerRequest

TIMEOUT_S = 60.0


def start_controllers(names: Sequence[str]) -> None:
    """Loads and starts controllers of the controller manager in the node's namespace.

    Args:
        names: Names of the controllers, whose parameters are set.

    Raises:
        AssertionError: A controller cannot be loaded or started.
        rospy.ROSException: The controller manager has no services within 60 s.
    """
    for service in ("load_controller", "switch_controller"):
        rospy.wait_for_service(f"controller_manager/{service}", TIMEOUT_S)
    load = rospy.ServiceProxy("controller_manager/load_controller", LoadController)
    for name in names:
        assert load(name).ok, f"controller '{name}' cannot be loaded"
    switch = rospy.ServiceProxy("controller_manager/switch_controller", SwitchController)
    assert switch(list(names), [], SwitchControllerRequest.STRICT, False, 0.0).ok, f"{names} cannot be started"
