# SPDX-License-Identifier: BSD-3-Clause
"""Starts a node such that an interrupt during its imports prints no traceback."""

from __future__ import annotations

import importlib
import signal
import sys
from typing import NoReturn


def run_node(module: str, function: str = "main") -> NoReturn:
    """Imports a module, calls one of its functions and exits with the returned code.

    An interrupt (SIGINT) before the node handles signals ends the process without a traceback: roslaunch interrupts all
    nodes when a required node has died, and the user needs to see the reason of that death. An interrupt while rospy
    starts the node ends the process too. Publishers of the node send without switching threads, and a client that sends
    nothing does not delay other clients. An invalid parameter ends the node with an error in the log.

    Args:
        module: Full name of the module.
        function: Name of the function, which takes no argument and returns the exit code.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    import rospy

    from modular_framework_ros.connections.inbound_connections import accept_connections_at_once
    from modular_framework_ros.connections.ros_direct_publishing import publish_directly
    from modular_framework_ros.node_handle import ParameterError

    publish_directly()
    accept_connections_at_once()
    try:
        sys.exit(getattr(importlib.import_module(module), function)())
    except ParameterError as error:
        rospy.logfatal("the node cannot start: %s", error)
        sys.exit(1)
    except rospy.exceptions.ROSInitException:
        if not rospy.core.is_shutdown():
            raise
        sys.exit(128 + signal.SIGINT)
