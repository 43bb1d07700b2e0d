# SPDX-License-Identifier: BSD-3-Clause
"""Input of a policy: camera images, robot state, prompt and the required actions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Mapping

import numpy as np

from mbf_method.grasp_request import RobotState

JOINT_KINDS = ("positions", "velocities", "deltas")
"""Kinds of joint actions: joint positions, joint velocities, differences between successive joint positions."""
END_EFFECTOR_DELTAS = "end_effector_deltas"
"""Kind of actions that displace the end effector."""
ACTION_KINDS = (*JOINT_KINDS, END_EFFECTOR_DELTAS)
END_EFFECTOR_COLUMNS = ("x", "y", "z", "rx", "ry", "rz")
"""Columns of end-effector deltas: translation [m] and rotation vector [rad] along the axes of a frame."""
GRIPPER_COLUMN = "gripper"
"""Name of the last column of actions with a gripper."""


@dataclass(frozen=True)
class CameraImages:
    """Latest images of a camera.

    Attributes:
        colour: RGB colours, shape (h, w, 3), uint8; shape (0, 0, 3) without a colour image.
        depth: Depths along the optical axis, shape (h, w) [m]; NaN for pixels without a measurement, shape (0, 0)
            without a depth image.
    """

    colour: np.ndarray
    depth: np.ndarray


@dataclass(frozen=True)
class ActionSpec:
    """Required actions.

    Limits that do not exist are infinite. End-effector deltas have no limits; the joints that follow them have.

    Attributes:
        kind: Meaning of the columns, one of `ACTION_KINDS`.
        names: Names of the columns: the joints or `END_EFFECTOR_COLUMNS`, then `GRIPPER_COLUMN` if the policy drives
            the gripper.
        horizon: Number of actions of a chunk.
        rate_hz: Number of actions per second.
        lower: Lower limits of the target positions, shape (a,) [rad or m]; 0 for the gripper.
        upper: Upper limits of the target positions, shape (a,) [rad or m]; 1 for the gripper.
        max_velocity: Velocity limits, shape (a,) [rad/s or m/s].
        max_acceleration: Acceleration limits, shape (a,) [rad/s^2 or m/s^2].
        link: Link that end-effector deltas move; "" for joint actions.
        frame: Frame whose axes end-effector deltas use; "" for joint actions.
    """

    kind: str
    names: tuple[str, ...]
    horizon: int
    rate_hz: float
    lower: np.ndarray
    upper: np.ndarray
    max_velocity: np.ndarray
    max_acceleration: np.ndarray
    link: str = ""
    frame: str = ""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joint columns; empty for end-effector deltas."""
        if self.kind == END_EFFECTOR_DELTAS:
            return ()
        return tuple(name for name in self.names if name != GRIPPER_COLUMN)


@dataclass(frozen=True)
class Observation:
    """Input of a policy.

    Attributes:
        robot: Positions of the joints that the actions move, in the order of the joint columns.
        gripper: Opening of the gripper as a fraction, from 0 (open) to 1 (closed); 0 without a gripper.
        cameras: Images, keyed by the camera names of the task.
        prompt: Instruction in words; "" for none.
        time_s: Time since the policy took over [s of the ROS clock].
        step: Number of actions executed so far.
        actions: Required actions.
        seed: Seed of all random numbers.
        end_effector: Pose of the link that end-effector deltas move, in their frame, shape (4, 4); shape (0, 0) for
            joint actions.
    """

    robot: RobotState
    gripper: float
    cameras: Mapping[str, CameraImages]
    prompt: str
    time_s: float
    step: int
    actions: ActionSpec
    seed: int
    end_effector: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @classmethod
    def from_message(cls, message: Mapping[str, Any]) -> Observation:
        """Creates the observation from the dictionary of a decoded message."""
        robot, actions = message["robot"], message["actions"]
        converted = {
            "robot": RobotState(tuple(robot["joint_names"]), robot["positions"]),
            "cameras": {name: CameraImages(**images) for name, images in message["cameras"].items()},
            "actions": ActionSpec(**{**actions, "names": tuple(actions["names"])}),
        }
        return cls(**{**message, **converted})
