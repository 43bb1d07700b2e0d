# SPDX-License-Identifier: BSD-3-Clause
"""Starts a node such that an interrupt during its imports prints no traceback."""

from __future__ import annotations

import importlib
import signal
import sys
from typing import NoReturn


def run_node(module: str, function: str = "main") -> NoReturn:
    """Imports a module, runs a function of it and exits with what that returns.

    An interrupt (SIGINT) before the node handles signals itself ends the process at once, without a traceback:
    roslaunch sends it to all nodes when one of them died, and the reason of that death is what the user needs to see.
    One that comes while rospy starts the node ends the process too. The node's publishers send without a change of
    threads. A parameter with a wrong value ends it with the fault in the log.

    Args:
        module: Full name of the module.
        function: Name of the function; it takes no argument and returns the exit code.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    import rospy

    from modular_framework_ros.node_handle import ParameterError
    from modular_framework_ros.ros_direct_publishing import publish_directly

    publish_directly()
    try:
        sys.exit(getattr(importlib.import_module(module), function)())
    except ParameterError as error:
        rospy.logfatal("the node cannot start: %s", error)
        sys.exit(1)
    except rospy.exceptions.ROSInitException:
        if not rospy.core.is_shutdown():
            raise
        sys.exit(128 + signal.SIGINT)
