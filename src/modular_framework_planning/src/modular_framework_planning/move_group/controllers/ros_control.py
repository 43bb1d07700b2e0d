# SPDX-License-Identifier: BSD-3-Clause
"""Controllers of ros_control's controller managers; stopped controllers are started when a motion needs them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import rosgraph
import rospy
from controller_manager_msgs.msg import ControllerState

from modular_framework_control.ros.controller_manager_client import (
    ControllerManagerClient,
    ControllerManagerClientError,
)
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.execution_messages import MotionPart
from modular_framework_planning.move_group.controllers.action_controllers import ActionControllers
from modular_framework_planning.trajectory_execution.controllers import GRIPPER, TRAJECTORY, ControllerSpec

LIST_SERVICE = "controller_manager/list_controllers"
MAX_AGE_S = 1.0  # maximum age of the list of controllers
# suffix of a controller's type -> kind and name of its action
CONTROLLER_TYPES = {
    "JointTrajectoryController": (TRAJECTORY, "follow_joint_trajectory"),
    "GripperActionController": (GRIPPER, "gripper_cmd"),
}


def spec_of(state: ControllerState, namespace: str = "/") -> ControllerSpec | None:
    """Returns the executor's description of a controller; None for a controller that executes no motions."""
    for suffix, (kind, action_ns) in CONTROLLER_TYPES.items():
        joints = tuple(dict.fromkeys(name for claim in state.claimed_resources for name in claim.resources))
        if state.type.endswith(suffix) and joints:
            return ControllerSpec(
                rosgraph.names.ns_join(namespace, state.name),
                action_ns,
                kind,
                joints,
                is_active=state.state == "running",
                command_joints=joints[:1],
            )
    return None


def running_claims(states: Sequence[ControllerState], joints: set[str], excluded: set[str]) -> list[str]:
    """Returns the names of running controllers that claim one of the joints.

    Args:
        states: Controllers of a controller manager.
        joints: Names of joints.
        excluded: Names of controllers to leave out.
    """
    return [
        state.name
        for state in states
        if state.state == "running"
        and state.name not in excluded
        and joints & {name for claim in state.claimed_resources for name in claim.resources}
    ]


def manager_namespaces() -> list[str]:
    """Returns the namespaces of all controller managers known to the ROS master."""
    services = rosgraph.Master(rospy.get_name()).getSystemState()[2]
    return sorted(name[: -len(LIST_SERVICE)] for name, _ in services if name.endswith(f"/{LIST_SERVICE}"))


class RosControlControllers(ActionControllers):
    """Uses controller_manager/list_controllers and, if allowed, controller_manager/switch_controller.

    Args:
        listed: Entries of ~controller_list, which add settings to controllers of the same name.
        namespace: Namespace of the controller manager; None for all controller managers.
        may_switch: Whether stopped controllers may be started and controllers that claim their joints stopped.
        timeout_s: Timeout for services and actions [s].
    """

    def __init__(
        self, listed: tuple[ControllerSpec, ...], namespace: str | None, may_switch: bool, timeout_s: float
    ) -> None:
        super().__init__((), timeout_s)
        self.may_switch = may_switch
        self._settings = {rosgraph.names.ns_join("/", spec.name): spec for spec in listed}
        self._namespace = namespace
        self._states: dict[str, list[ControllerState]] = {}
        self._listed_s = -MAX_AGE_S

    def describe(self) -> str:
        """Returns the namespace of the controller manager as text."""
        return f"controllers of {'all controller managers' if self._namespace is None else self._namespace}"

    def controllers(self) -> tuple[ControllerSpec, ...]:
        """Returns the loaded controllers, at most MAX_AGE_S old."""
        if time.monotonic() - self._listed_s > MAX_AGE_S:
            self._update()
        specs = []
        for namespace, states in self._states.items():
            for spec in (spec_of(state, namespace) for state in states):
                if spec is not None:
                    settings = self._settings.get(spec.name)
                    specs.append(
                        spec
                        if settings is None
                        else replace(
                            settings,
                            name=spec.name,
                            action_ns=spec.action_ns,
                            kind=spec.kind,
                            joints=spec.joints,
                            is_active=spec.is_active,
                            command_joints=settings.command_joints or spec.command_joints,
                        )
                    )
        return tuple(specs)

    def _update(self) -> None:
        namespaces = manager_namespaces() if self._namespace is None else [self._namespace]
        try:
            self._states = {name: self._client_of(name).list_controllers() for name in namespaces}
        except ControllerManagerClientError as error:
            raise PlanningError(
                ErrorCode.CONTROL_FAILED,
                f"cannot list controllers: {error}; is the controller "
                f"manager running, and is {rospy.resolve_name('~ros_control_namespace')} its "
                "namespace?",
            ) from error
        self._listed_s = time.monotonic()

    def _client_of(self, namespace: str) -> ControllerManagerClient:
        return ControllerManagerClient(namespace, self._timeout_s)

    def prepare(self, parts: Sequence[MotionPart]) -> None:
        """Starts stopped controllers, then waits for the actions; raises PlanningError."""
        for namespace, states in self._states.items():
            stopped = [
                part.controller
                for part in parts
                if not part.controller.is_active
                and part.controller.name in {rosgraph.names.ns_join(namespace, state.name) for state in states}
            ]
            if stopped:
                self._start(namespace, states, stopped)
        super().prepare(parts)

    def _start(self, namespace: str, states: Sequence[ControllerState], specs: Sequence[ControllerSpec]) -> None:
        start = [spec.name.rsplit("/", 1)[-1] for spec in specs]
        stop = running_claims(states, {joint for spec in specs for joint in spec.joints}, set(start))
        rospy.loginfo("starting controllers %s, stopping %s", ", ".join(start), ", ".join(stop) or "none")
        self._listed_s = -MAX_AGE_S
        try:
            self._client_of(namespace).switch(start, stop)
        except ControllerManagerClientError as error:
            raise PlanningError(ErrorCode.CONTROL_FAILED, str(error)) from error
