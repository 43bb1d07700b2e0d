# SPDX-License-Identifier: BSD-3-Clause
"""Publishes from threads that still run during the shutdown of the node, without useless errors."""

from __future__ import annotations

from typing import Any

import rospy


def going_down() -> bool:
    """Whether the node is being shut down: rospy closes the topics before it says so by is_shutdown()."""
    return bool(rospy.core.is_shutdown_requested())


def publish(publisher: rospy.Publisher, message: Any) -> None:
    """Publishes a message; a topic that is closed because the node shuts down is no error.

    Raises:
        rospy.ROSException: the topic is closed, or the message does not fit, while the node runs on.
    """
    try:
        publisher.publish(message)
    except rospy.ROSException as error:
        if not going_down():
            raise
        rospy.logdebug("topic %s is closed: %s", publisher.name, error)
