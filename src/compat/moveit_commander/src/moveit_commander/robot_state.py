# SPDX-License-Identifier: BSD-3-Clause
"""Current state of the robot: description from the parameter server, joints from joint_states, base from tf."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterable, Mapping
from typing import Any

import rospy
from geometry_msgs.msg import Quaternion, Transform, Vector3
from moveit_msgs.msg import RobotState
from rosgraph.names import ns_join
from sensor_msgs.msg import JointState

from modular_framework_ros.parameter_search import nearest_parameter
from moveit_commander.exception import RobotModelError, ServerError
from moveit_commander.robot_model import RobotModel
from moveit_commander.roscpp_initializer import ensure_node, on_shutdown

STATE_TIMEOUT_S = 1.0
PLANAR = "planar"
_shared: dict[tuple[str, str], CurrentState] = {}
_shared_lock = threading.Lock()


def load_model(robot_description: str) -> RobotModel:
    """Returns the model from the parameters `<robot_description>`, `_semantic` and `_planning`.

    Raises:
        RobotModelError: One of the first two parameters is missing or invalid.
    """
    texts = []
    for parameter in (robot_description, f"{robot_description}_semantic"):
        text = rospy.get_param(nearest_parameter(parameter), None)
        if not isinstance(text, str):
            raise RobotModelError(
                f"parameter {rospy.resolve_name(parameter)}: got {type(text).__name__}, the text of "
                "the robot's description is needed; load it (planning_context.launch) or name "
                "a different parameter in the argument robot_description"
            )
        texts.append(text)
    limits = rospy.get_param(f"{nearest_parameter(f'{robot_description}_planning')}/joint_limits", {})
    return RobotModel(texts[0], texts[1], limits if isinstance(limits, dict) else {})


def current_state(robot_description: str, ns: str) -> CurrentState:
    """Returns the listener of a robot, shared by its commanders; raises RobotModelError."""
    ensure_node()
    key = (str(rospy.resolve_name(robot_description)), str(rospy.resolve_name(ns_join(ns, "joint_states"))))
    with _shared_lock:
        if key not in _shared:
            _shared[key] = CurrentState(load_model(robot_description), key[1])
        return _shared[key]


def _tf_buffer() -> Any:
    """Returns a buffer with a tf listener."""
    import tf2_ros  # slow to import and needed by few robots

    buffer = tf2_ros.Buffer()
    buffer.listener = tf2_ros.TransformListener(buffer)  # lives as long as the buffer
    return buffer


def _close_all() -> None:
    with _shared_lock:
        for state in _shared.values():
            state.close()
        _shared.clear()


class CurrentState:
    """Latest joint states of a topic.

    Subscribes: joint_states (sensor_msgs/JointState); tf for a planar or floating virtual joint.
    """

    def __init__(self, model: RobotModel, topic: str) -> None:
        self.model = model
        self._topic = topic
        self._positions: dict[str, float] = {}
        self._arrivals: dict[str, float] = {}
        self._changed = threading.Condition()
        self._transforms = _tf_buffer() if model.base else None
        self._subscriber = rospy.Subscriber(topic, JointState, self._on_joint_state, queue_size=10, tcp_nodelay=True)
        on_shutdown(_close_all)

    def close(self) -> None:
        """Unsubscribes; repeated calls are allowed."""
        self._subscriber.unregister()
        if self._transforms is not None:
            self._transforms.listener.unregister()

    def positions(self, variables: Iterable[str] = (), timeout_s: float = STATE_TIMEOUT_S) -> dict[str, float]:
        """Returns positions received after this call [rad or m], with mimic joints and a base that tf provides.

        Args:
            variables: Variables to wait for; empty for every active joint that is not passive.
            timeout_s: Maximum wait [s].

        Raises:
            ServerError: A required joint was not received in time.
        """
        names = set(variables) or {variable.name for variable in self.model.variables}
        names = {self.model.mimics[name].leader if name in self.model.mimics else name for name in names}
        names -= self.model.passive | {variable.name for variable in self.model.base_variables}
        start_s = time.monotonic()
        with self._changed:
            if not self._changed.wait_for(lambda: self._received_since(names, start_s), timeout_s):
                missing = sorted(name for name in names if self._arrivals.get(name, 0.0) < start_s)
                raise ServerError(
                    f"topic {self._topic}: waited {timeout_s:g} s for joint states, nothing came for "
                    f"{', '.join(missing)}; does the joint state controller run?"
                )
            received = dict(self._positions)
        return self.model.complete(received | self._base_values())

    def message(self, variables: Iterable[str] = ()) -> RobotState:
        """Returns the current state as a message in the planning frame; `positions` documents the arguments.

        Without a planar or floating base from tf, move_group keeps its own base pose.
        """
        return self.message_of(self.positions(variables))

    def _base_values(self) -> dict[str, float]:
        """Returns the variables of a planar or floating base from tf; empty if tf has no transform."""
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
        """Returns the positions in a message, including the variables of a planar or floating base."""
        values = dict(zip(state.joint_state.name, state.joint_state.position, strict=True))
        multi = state.multi_dof_joint_state
        for name, transform in zip(multi.joint_names, multi.transforms, strict=True):
            if self.model.base is not None and name == self.model.base.name:
                values |= base_values(self.model, transform)
        return values

    def _received_since(self, names: Iterable[str], start_s: float) -> bool:
        return all(self._arrivals.get(name, 0.0) >= start_s for name in names)

    def _on_joint_state(self, message: JointState) -> None:
        now = time.monotonic()
        with self._changed:
            for name, position in zip(message.name, message.position, strict=False):
                self._positions[name], self._arrivals[name] = position, now
            self._changed.notify_all()


def base_values(model: RobotModel, transform: Transform) -> dict[str, float]:
    """Returns the variables of the robot's base for a transform; a planar base uses only x, y and the heading.

    Args:
        model: Model of a robot with a planar or floating base.
        transform: Transform from the root link to the parent frame of the base.
    """
    t, q = transform.translation, transform.rotation
    if model.base is not None and model.base.kind == PLANAR:
        heading = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
        values = [t.x, t.y, heading]
    else:
        values = [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
    return {variable.name: value for variable, value in zip(model.base_variables, values, strict=True)}


def base_transform(model: RobotModel, positions: Mapping[str, float]) -> Transform:
    """Returns the transform of the robot's base for the values of its variables; normalises the quaternion."""
    values = [positions[variable.name] for variable in model.base_variables]
    if model.base is not None and model.base.kind == PLANAR:
        x, y, heading = values
        return Transform(Vector3(x, y, 0.0), Quaternion(0.0, 0.0, math.sin(heading / 2.0), math.cos(heading / 2.0)))
    length = math.hypot(*values[3:]) or 1.0
    return Transform(Vector3(*values[:3]), Quaternion(*(number / length for number in values[3:])))
