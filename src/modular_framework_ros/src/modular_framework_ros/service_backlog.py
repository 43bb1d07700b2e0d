# SPDX-License-Identifier: BSD-3-Clause
"""Lets many clients call a node's services at the same moment."""

from __future__ import annotations

import rospy
from rospy.impl.tcpros_base import init_tcpros_server

BACKLOG = 128


def widen_backlog() -> None:
    """Extends the queue of pending service connections; call it after rospy.init_node.

    rospy's queue holds five connections, and every service call needs one or two. Linux drops the sixth, and its client
    retries after a second. The queue length of a listening socket may be changed at any time.
    """
    server = init_tcpros_server()
    server.start_server()
    socket = getattr(server.tcp_ros_server, "server_sock", None)
    if socket is None:
        rospy.logdebug("rospy's server socket was not found: service calls may wait for a second under load")
    else:
        socket.listen(BACKLOG)
