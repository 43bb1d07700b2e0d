# SPDX-License-Identifier: BSD-3-Clause
"""The current robot: its description from the parameter server, joint positions from joint_states, a base from tf."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Mapping
from typing import Any

import rospy
from moveit_msgs.msg import RobotState
from rosgraph.names import ns_join
from sensor_msgs.msg import JointState

from modular_framework_ros.parameter_search import nearest_parameter
from moveit_commander.base_joint import base_transform, base_values
from moveit_commander.exception import RobotModelError, ServerError
from moveit_commander.robot_model import RobotModel
from moveit_commander.roscpp_initializer import ensure_node, on_shutdown

STATE_TIMEOUT_S = 1.0
_shared: dict[tuple[str, str], CurrentState] = {}
_sharing = threading.Lock()


def load_model(robot_description: str) -> RobotModel:
    """Reads URDF, SRDF and joint limits from the parameters `<robot_description>`, `_semantic` and `_planning`.

    Raises:
        RobotModelError: one of the first two is not there or cannot be read.
    """
    texts = []
    for parameter in (robot_description, f"{robot_description}_semantic"):
        text = rospy.get_param(nearest_parameter(parameter), None)
        if not isinstance(text, str):
            raise RobotModelError(
                f"parameter {rospy.resolve_name(parameter)}: got {type(text).__name__}, the text of "
                "the robot's description is needed; load it (planning_context.launch) or name "
                "another one by the argument robot_description"
            )
        texts.append(text)
    limits = rospy.get_param(f"{nearest_parameter(f'{robot_description}_planning')}/joint_limits", {})
    return RobotModel(texts[0], texts[1], limits if isinstance(limits, dict) else {})


def current_state(robot_description: str, ns: str) -> CurrentState:
    """Returns the listener of a robot; the commanders of one robot share it. Raises RobotModelError."""
    ensure_node()
    key = (str(rospy.resolve_name(robot_description)), str(rospy.resolve_name(ns_join(ns, "joint_states"))))
    with _sharing:
        if key not in _shared:
            _shared[key] = CurrentState(load_model(robot_description), key[1])
        return _shared[key]


def _tf_buffer() -> Any:
    """Returns a buffer that listens to tf."""
    import tf2_ros  # few robots need it, and it takes long to import

    buffer = tf2_ros.Buffer()
    buffer.listener = tf2_ros.TransformListener(buffer)  # kept as long as the buffer
    return buffer


def _forget_all() -> None:
    with _sharing:
        for state in _shared.values():
            state.close()
        _shared.clear()


class CurrentState:
    """Stores the latest joint states of a topic.

    Subscribes: joint_states (sensor_msgs/JointState); tf where the robot has a planar or floating virtual joint.
    """

    def __init__(self, model: RobotModel, topic: str) -> None:
        self.model = model
        self._topic = topic
        self._positions: dict[str, float] = {}
        self._arrivals: dict[str, float] = {}
        self._changed = threading.Condition()
        self._transforms = _tf_buffer() if model.base else None
        self._subscriber = rospy.Subscriber(topic, JointState, self._on_joint_state, queue_size=10, tcp_nodelay=True)
        on_shutdown(_forget_all)

    def close(self) -> None:
        """Stops listening. May be called twice."""
        self._subscriber.unregister()
        if self._transforms is not None:
            self._transforms.listener.unregister()

    def positions(self, needed: Iterable[str] = (), timeout_s: float = STATE_TIMEOUT_S) -> dict[str, float]:
        """Returns positions that arrived after this call [rad or m], mimic joints included.

        A planar or floating base is among them, by its variables, where tf has it.

        Args:
            needed: variables that must be heard of; none: every active joint that is not passive.
            timeout_s: how long to wait [s].

        Raises:
            ServerError: a needed joint was not heard of in time.
        """
        names = set(needed) or {variable.name for variable in self.model.variables}
        names = {self.model.mimics[name].leader if name in self.model.mimics else name for name in names}
        names -= self.model.passive | {variable.name for variable in self.model.base_variables}
        begun = time.monotonic()
        with self._changed:
            if not self._changed.wait_for(lambda: self._fresh(names, begun), timeout_s):
                missing = sorted(name for name in names if self._arrivals.get(name, 0.0) < begun)
                raise ServerError(
                    f"topic {self._topic}: waited {timeout_s:g} s for joint states, nothing came for "
                    f"{', '.join(missing)}; does the joint state controller run?"
                )
            heard = dict(self._positions)
        return self.model.complete(heard | self._base_values())

    def message(self, needed: Iterable[str] = ()) -> RobotState:
        """Returns the whole known state as a message, in the planning frame; `needed` as above.

        It has a planar or floating base where tf has it; without, move_group leaves the base where it knows it to be.
        """
        return self.message_of(self.positions(needed))

    def _base_values(self) -> dict[str, float]:
        """Returns the variables of a planar or floating base from tf; none where tf does not have it."""
        base = self.model.base
        if base is None or self._transforms is None:
            return {}
        if not self._transforms.can_transform(base.parent_frame, base.child_link, rospy.Time(0)):
            return {}
        found = self._transforms.lookup_transform(base.parent_frame, base.child_link, rospy.Time(0))
        return base_values(self.model, found.transform)

    def message_of(self, positions: Mapping[str, float]) -> RobotState:
        """Returns a message of given positions; as in MoveIt, it has no time stamp."""
        state = RobotState()
        base = {variable.name for variable in self.model.base_variables}
        joints = {name: value for name, value in positions.items() if name not in base}
        state.joint_state.header.frame_id = self.model.planning_frame
        state.joint_state.name = list(joints)
        state.joint_state.position = list(joints.values())
        state.multi_dof_joint_state.header = state.joint_state.header
        if self.model.base is not None and base <= positions.keys():
            state.multi_dof_joint_state.joint_names = [self.model.base.name]
            state.multi_dof_joint_state.transforms = [base_transform(self.model, positions)]
        return state

    def values_of(self, state: RobotState) -> dict[str, float]:
        """Returns the positions in a message, those of a planar or floating base by its variables."""
        values = dict(zip(state.joint_state.name, state.joint_state.position, strict=True))
        multi = state.multi_dof_joint_state
        for name, transform in zip(multi.joint_names, multi.transforms, strict=True):
            if self.model.base is not None and name == self.model.base.name:
                values |= base_values(self.model, transform)
        return values

    def _fresh(self, names: Iterable[str], begun: float) -> bool:
        return all(self._arrivals.get(name, 0.0) >= begun for name in names)

    def _on_joint_state(self, message: JointState) -> None:
        now = time.monotonic()
        with self._changed:
            for name, position in zip(message.name, message.position, strict=False):
                self._positions[name], self._arrivals[name] = position, now
            self._changed.notify_all()
