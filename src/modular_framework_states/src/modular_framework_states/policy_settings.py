# SPDX-License-Identifier: BSD-3-Clause
"""Options of a task for a policy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class RecordedEpisode:
    """Episode of a LeRobot dataset, replayed in place of a policy.

    Attributes:
        folder: Folder of the dataset.
        number: Index of the episode, from 0.
    """

    folder: Path
    number: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicySettings:
    """Options of a task for a policy.

    Attributes:
        openpi_keys: Keys of an openpi-style server, by field; empty for a policy of mbf_method.
        prompt: Instruction for the policy.
        kind: Meaning of the columns.
        frame: Frame of end-effector deltas; "" for the planning frame.
        joints: Joints that the policy moves; empty for all joints of the planning group.
        postures: Open and closed posture of the gripper; empty without a gripper column.
        horizon: Number of actions of a chunk.
        rate_hz: Number of actions per second.
        executed: Number of actions that run before the next query.
        accelerates: Whether the acceleration limits of the joints count.
        clamp: Whether targets outside the limits are moved to the limits.
        max_duration_s: Maximum duration of the policy [s].
        must_finish: Whether the policy must be done within the maximum duration.
        camera_timeout_s: Maximum wait for images [s].
    """

    openpi_keys: Mapping[str, str]
    prompt: str
    kind: str
    frame: str
    joints: tuple[str, ...]
    postures: tuple[str, ...]
    horizon: int
    rate_hz: float
    executed: int
    accelerates: bool
    clamp: bool
    max_duration_s: float
    must_finish: bool
    camera_timeout_s: float
