# SPDX-License-Identifier: BSD-3-Clause
"""Hierarchical state machines: the public interface of smach 2.5.2, written anew."""
# The logging functions and the errors come first: the other modules look them up in the package at call time.
from smach.log import logdebug, logerr, loginfo, logwarn, set_loggers  # isort: skip
from smach.exceptions import (  # isort: skip
    InvalidConstructionError,
    InvalidStateError,
    InvalidTransitionError,
    InvalidUserCodeError,
    SmachError,
)
from smach.util import (  # isort: skip
    CBInterface,
    cb_interface,
    has_smach_interface,
    is_shutdown,
    set_shutdown_check,
)
from smach.user_data import Remapper, UserData  # isort: skip
from smach.state import CBState, State  # isort: skip
from smach.container import Container  # isort: skip
from smach.state_machine import StateMachine  # isort: skip
from smach.concurrence import Concurrence  # isort: skip
from smach.sequence import Sequence  # isort: skip
from smach.iterator import Iterator  # isort: skip

__all__ = [
    "CBInterface",
    "CBState",
    "Concurrence",
    "Container",
    "InvalidConstructionError",
    "InvalidStateError",
    "InvalidTransitionError",
    "InvalidUserCodeError",
    "Iterator",
    "Remapper",
    "Sequence",
    "SmachError",
    "State",
    "StateMachine",
    "UserData",
    "cb_interface",
    "has_smach_interface",
    "is_shutdown",
    "logdebug",
    "logerr",
    "loginfo",
    "logwarn",
    "set_loggers",
    "set_shutdown_check",
]
