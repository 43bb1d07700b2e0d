# SPDX-License-Identifier: BSD-3-Clause
"""Messages as bytes, the form in which MoveIt's bindings take and return them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import rospy
from moveit_commander import conversions
from moveit_commander.exception import MoveItCommanderException

Message = TypeVar("Message")


def read(kind: type[Message], data: bytes) -> Message:
    """Returns the message of a type that was serialized to `data`.

    Raises:
        TypeError: `data` is not of type bytes.
        genpy.DeserializationError: `data` is no message of this type.
    """
    if not isinstance(data, bytes):
        raise TypeError(
            f"Python argument types in a call of moveit_ros_planning_interface do not match: got "
            f"{type(data).__name__}, a serialized {getattr(kind, '_type', kind.__name__)} (bytes) is "
            "needed; create the bytes with moveit_commander.conversions.msg_to_string"
        )
    message = kind()
    conversions.msg_from_string(message, data)
    return message


def write(message: Any) -> bytes:
    """Returns a message as bytes."""
    return conversions.msg_to_string(message)


def accepted(setter: Callable[..., Any], *arguments: Any) -> bool:
    """Calls a method that raises when it refuses its arguments; logs the refusal and returns False then."""
    try:
        setter(*arguments)
    except MoveItCommanderException as error:
        rospy.logerr("%s", error)
        return False
    return True
