# SPDX-License-Identifier: BSD-3-Clause
"""Lets many clients call a node's services at the same moment."""

from __future__ import annotations

import rospy
from rospy.impl.tcpros_base import init_tcpros_server

BACKLOG = 128


def widen_backlog() -> None:
    """To be called after rospy.init_node.

    rospy lets five connections wait to be accepted, and every call of a service is one or two of them. Linux drops the
    sixth, whose client tries again after a second. A listening socket takes a new length of the queue at any time.
    """
    server = init_tcpros_server()
    server.start_server()
    socket = getattr(server.tcp_ros_server, "server_sock", None)
    if socket is None:
        rospy.logdebug("rospy keeps its server elsewhere: calls of services may wait for a second under load")
    else:
        socket.listen(BACKLOG)
