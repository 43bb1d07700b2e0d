# SPDX-License-Identifier: BSD-3-Clause
"""The shipped controllers pass the conformance suite of controllers; controllers with a fault do not."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from modular_framework_control.controller_interface.controller import Controller
from modular_framework_control.controller_manager.controller_types import ControllerTypes
from modular_framework_control.hardware_interface.interfaces import PositionJointInterface
from modular_framework_ros.node_handle import NodeHandle, read_names
from modular_framework_testing.control.controller_conformance import ControllerConformance

JOINTS = ["joint_1", "joint_2"]
STIFF, SOFT = {"p": 100.0, "d": 20.0}, {"p": 20.0}
TRAJECTORY = {"joints": JOINTS}
SHIPPED: dict[str, dict[str, Any]] = {
    "position_controllers/JointTrajectoryController": TRAJECTORY,
    "pos_vel_controllers/JointTrajectoryController": TRAJECTORY,
    "pos_vel_acc_controllers/JointTrajectoryController": TRAJECTORY,
    "velocity_controllers/JointTrajectoryController": {**TRAJECTORY, "gains": dict.fromkeys(JOINTS, SOFT)},
    "effort_controllers/JointTrajectoryController": {**TRAJECTORY, "gains": dict.fromkeys(JOINTS, STIFF)},
    "position_controllers/JointGroupPositionController": TRAJECTORY,
    "velocity_controllers/JointGroupVelocityController": TRAJECTORY,
    "effort_controllers/JointGroupEffortController": TRAJECTORY,
    "effort_controllers/JointGroupPositionController": {**TRAJECTORY, **dict.fromkeys(JOINTS, {"pid": STIFF})},
    "position_controllers/JointPositionController": {"joint": "joint_1"},
    "velocity_controllers/JointPositionController": {"joint": "joint_1", "pid": SOFT},
    "velocity_controllers/JointVelocityController": {"joint": "joint_1"},
    "effort_controllers/JointPositionController": {"joint": "joint_1", "pid": STIFF},
    "effort_controllers/JointVelocityController": {"joint": "joint_1", "pid": SOFT},
    "effort_controllers/JointEffortController": {"joint": "joint_1"},
    "position_controllers/GripperActionController": {"joint": "joint_1"},
    "effort_controllers/GripperActionController": {"joint": "joint_1", "gains": {"joint_1": STIFF}},
    "diff_drive_controller/DiffDriveController": {
        "left_wheel": "joint_1", "right_wheel": "joint_2", "wheel_separation": 0.4, "wheel_radius": 0.1,
        "pose_covariance_diagonal": [1.0] * 6, "twist_covariance_diagonal": [1.0] * 6,
    },
}  # fmt: skip


def _suite(type_name: str, parameters: dict[str, Any]) -> type[ControllerConformance]:
    attributes = {
        "controller": type(ControllerTypes().create(type_name)),
        "parameters": parameters,
        "joints": JOINTS[:1] if "joint" in parameters else JOINTS,
        "joint_parameter": next((name for name in ("joints", "joint") if name in parameters), ""),
    }
    return type("Test" + type_name.replace("/", "_"), (ControllerConformance,), attributes)


globals().update({suite.__name__: suite for suite in (_suite(*entry) for entry in SHIPPED.items())})


class _Faulty(Controller):
    interface_class = PositionJointInterface

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        self.handles = [hw.get_handle(name) for name in read_names(controller_nh, "joints")]
        return True

    def command(self, positions: Callable[[Any], float]) -> None:
        for handle in self.handles:
            handle.command = positions(handle)


class GoesHome(_Faulty):
    """Commands 0 from the start on."""

    def update(self, time_s: float, period_s: float) -> None:
        self.command(lambda handle: 0.0)


class Remembers(_Faulty):
    """Returns to where the joints were at its first start."""

    first: dict[str, float] | None = None

    def starting(self, time_s: float) -> None:
        self.first = self.first or {handle.name: handle.state.position for handle in self.handles}

    def update(self, time_s: float, period_s: float) -> None:
        self.command(lambda handle: (self.first or {})[handle.name])


class ReadsTheClock(_Faulty):
    """Moves with real time."""

    def starting(self, time_s: float) -> None:
        self.begin_s = time.monotonic()

    def update(self, time_s: float, period_s: float) -> None:
        self.command(lambda handle: time.monotonic() - self.begin_s)


class Blocks(_Faulty):
    """Sleeps in the loop."""

    def update(self, time_s: float, period_s: float) -> None:
        time.sleep(0.002)


class LeavesAThread(_Faulty):
    """Does not end the thread that it starts."""

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        threading.Thread(target=threading.Event().wait, args=(5.0,), daemon=True).start()
        return super().init(hw, root_nh, controller_nh)


@pytest.mark.parametrize(
    ("controller", "test", "arguments"),
    [
        (GoesHome, "test_a_start_moves_no_joint", (0.7,)),
        (Remembers, "test_a_second_start_holds_the_joints_where_they_are_then", ()),
        (Remembers, "test_joints_moved_during_a_fault_stay_there_afterwards", ()),
        (ReadsTheClock, "test_the_controller_uses_only_the_time_of_its_cycles", ()),
        (Blocks, "test_an_update_does_not_block_the_loop", ()),
        (LeavesAThread, "test_an_unloaded_controller_leaves_no_thread", ()),
    ],
)
def test_a_controller_with_a_fault_does_not_pass(
    controller: type[Controller], test: str, arguments: tuple[float, ...]
) -> None:
    suite = ControllerConformance()
    suite.controller, suite.parameters = controller, {"joints": JOINTS}  # type: ignore[misc]
    with pytest.raises(AssertionError):
        getattr(suite, test)(*arguments)
