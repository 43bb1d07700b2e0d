# SPDX-License-Identifier: BSD-3-Clause
"""Checks the results of a method for recorded inputs, and describes each fault in a sentence.

The checks find common misunderstandings: frame, units, axes, order of a quaternion, order of the joints, degrees, and a
seed without effect. They know neither the reach of a robot nor its collisions, which an experiment checks.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any, Callable, Mapping, Sequence

import numpy as np

from mbf_method.actions import checked_actions, limited_targets
from mbf_method.errors import InvalidOutputError, MethodError
from mbf_method.grasp_request import GraspRequest
from mbf_method.grasps import Grasps, checked_grasps
from mbf_method.joint_path import END_TOLERANCE, checked_path
from mbf_method.observation import END_EFFECTOR_DELTAS, GRIPPER_COLUMN, JOINT_KINDS, ActionSpec, Observation
from mbf_method.path_request import PathRequest
from mbf_method.served_method import ServedMethod
from mbf_method.wire import pack, unpack

MAX_ITEMS = 100_000
"""Maximum number of grasps or points of a result."""
FAR_M = 0.15
"""Distance between object and pads above which a grasp belongs to another frame or unit [m]."""
REQUIRED_FRACTION = 0.5
"""Fraction of the grasps of an input that must close on the object, and that must be above its support."""
SUGGESTED_FRACTION = 0.9
"""Fraction of the grasps that a suggested correction must repair."""
WIDTH_TOLERANCE_M = 0.01
MAX_SPEED_M_S, MAX_TURN_RAD_S = 5.0, 10.0
"""Speeds of an end effector above which deltas belong to another unit."""
SUPPORT_TOLERANCE_M = 0.001

Call = Callable[[Any], Mapping[str, Any]]
"""Function that returns the decoded result of a request."""


@dataclass(frozen=True)
class Findings:
    """Result of a check.

    Attributes:
        faults: Sentences about faults.
        notes: Sentences about properties that are no faults, such as the number of grasps.
    """

    faults: tuple[str, ...]
    notes: tuple[str, ...]


def local_call(method: ServedMethod) -> Call:
    """Returns a function that calls a method of this process as the framework does, with encoded messages.

    Args:
        method: Decorated function.
    """
    return lambda request: unpack(pack(method(method.read_request(unpack(pack(request))))))


def check_grasp_method(call: Call, requests: Sequence[GraspRequest]) -> Findings:
    """Checks a grasp method.

    Args:
        call: Function that calls the method.
        requests: Inputs.
    """
    names = [f"input {number} (object '{request.target.name}')" for number, request in enumerate(requests, start=1)]

    def check(request: GraspRequest, name: str, faults: list[str], notes: list[str]) -> bool:
        grasps = checked_grasps(_repeated(call, request, name, faults, notes), request, MAX_ITEMS)
        if not len(grasps.scores):
            notes.append(f"{name}: no grasp.")
            return False
        low = _fraction_below_support(grasps, request)
        notes.append(f"{name}: {len(grasps.scores)} grasps, {low:.0%} of them unreachable below the support.")
        faults += [f"{name}: {text}" for text in _grasp_faults(grasps, request)]
        return True

    return _check_inputs(dict(zip(names, requests)), check, "the method found no grasp for any input.")


def check_planner(call: Call, requests: Sequence[PathRequest]) -> Findings:
    """Checks a planner.

    Args:
        call: Function that calls the planner.
        requests: Inputs.
    """

    def check(request: PathRequest, name: str, faults: list[str], notes: list[str]) -> bool:
        message = _repeated(call, request, name, faults, notes, allowed_time_s=request.allowed_time_s)
        try:
            path = checked_path(message, request, MAX_ITEMS)
        except InvalidOutputError as error:
            raise InvalidOutputError(f"{error}{_path_hint(message.get('positions'), request)}") from error
        notes.append(f"{name}: path of {len(path)} points." if len(path) else f"{name}: no path.")
        return bool(len(path))

    return _check_inputs(_numbered(requests), check, "the planner found no path for any input.")


def check_policy(call: Call, inputs: Sequence[Observation]) -> Findings:
    """Checks a policy.

    Args:
        call: Function that calls the policy.
        inputs: Observations.
    """

    def check(observation: Observation, name: str, faults: list[str], notes: list[str]) -> bool:
        actions = checked_actions(_repeated(call, observation, name, faults, notes), observation.actions)
        notes.append(f"{name}: {len(actions)} actions." if len(actions) else f"{name}: the task is done.")
        if observation.actions.kind == END_EFFECTOR_DELTAS:
            faults += [f"{name}: {text}." for text in _displacement_faults(actions, observation.actions)]
            return bool(len(actions))
        targets = limited_targets(actions, observation.actions, _start(observation))
        if targets.fault:
            faults.append(f"{name}: {targets.fault}{_action_hint(actions, observation)}.")
        return bool(len(actions))

    return _check_inputs(_numbered(inputs), check, "the policy returned no action for any input.")


def _numbered(inputs: Sequence[Any]) -> dict[str, Any]:
    return {f"input {number}": item for number, item in enumerate(inputs, start=1)}


def _check_inputs(
    inputs: Mapping[str, Any], check: Callable[[Any, str, list[str], list[str]], bool], nothing_found: str
) -> Findings:
    """Checks the results for all inputs.

    Args:
        inputs: Inputs by name.
        check: Function of input, name, faults and notes, which adds to the lists and returns whether the method found
            something. Raises MethodError for an invalid result.
        nothing_found: Fault if the method found nothing for any input.
    """
    faults: list[str] = []
    notes: list[str] = []
    found = False
    for name, item in inputs.items():
        try:
            found = check(item, name, faults, notes) or found
        except MethodError as error:
            faults.append(f"{name}: {error}.")
    if not found and not faults:
        faults.append(nothing_found)
    return Findings(tuple(faults), tuple(notes))


def _repeated(
    call: Call, request: Any, name: str, faults: list[str], notes: list[str], *, allowed_time_s: float = np.inf
) -> Mapping[str, Any]:
    """Calls a method twice and returns the first result; adds a fault if the results differ or are late."""
    start_s = time.perf_counter()
    first = call(request)
    duration_s = time.perf_counter() - start_s
    notes.append(f"{name}: {duration_s:.3f} s.")
    if duration_s > allowed_time_s:
        faults.append(f"{name}: the result took {duration_s:.2f} s; at most {allowed_time_s:.2f} s are allowed.")
    if pack(first) != pack(call(request)):
        faults.append(
            f"{name}: two calls with seed {request.seed} gave different results; take all random numbers from a "
            "generator that is created from the seed of the request."
        )
    return first


def _grasp_faults(grasps: Grasps, request: GraspRequest) -> list[str]:
    if np.median(_distances(grasps.poses, request)) > FAR_M:
        return [_frame_fault(grasps, request)]
    faults = []
    fraction = _fraction_closing(grasps.poses, grasps.widths, request)
    if fraction < REQUIRED_FRACTION:
        faults.append(
            f"{1 - fraction:.0%} of the grasps do not close on the object with the returned width; x must be the "
            "closing direction, z the approach direction, and the origin the centre between the pads"
            f"{_closing_hint(grasps, request)}."
        )
    low = _fraction_below_support(grasps, request)
    if low > REQUIRED_FRACTION:
        faults.append(f"{low:.0%} of the grasps put a fingertip below the surface that supports the object.")
    return faults


def _fraction_below_support(grasps: Grasps, request: GraspRequest) -> float:
    """Returns the fraction of the grasps that no robot can reach, because a fingertip is below the support."""
    tips_z = grasps.poses[:, 2, 3] + request.gripper.fingertip * grasps.poses[:, 2, 2]
    return float((tips_z < request.support_z - SUPPORT_TOLERANCE_M).mean())


def _distances(poses: np.ndarray, request: GraspRequest) -> np.ndarray:
    """Returns the distance of each pose from the nearest point of the object, shape (n,) [m]."""
    points = request.target.points
    return np.array([np.linalg.norm(points - pose[:3, 3], axis=1).min() for pose in poses])


def _frame_fault(grasps: Grasps, request: GraspRequest) -> str:
    distance = np.median(_distances(grasps.poses, request))
    text = f"the grasps lie {distance:.3g} m from the object; the poses must be in frame '{request.frame}', in metres"
    in_metres = grasps.poses.copy()
    in_metres[:, :3, 3] *= 1e-3
    if np.median(_distances(in_metres, request)) < FAR_M:
        return f"{text}; they seem to be in millimetres."
    if request.camera is not None:
        moved = request.camera.pose @ grasps.poses
        if np.median(_distances(moved, request)) < FAR_M:
            return f"{text}; they seem to be in the camera frame: multiply them by camera.pose."
    centred = grasps.poses.copy()
    centred[:, :3, 3] += request.target.points.mean(axis=0)
    if np.median(_distances(centred, request)) < FAR_M:
        return f"{text}; they seem to be relative to the object."
    return f"{text}."


def _fraction_closing(poses: np.ndarray, widths: np.ndarray, request: GraspRequest) -> float:
    """Returns the fraction of the grasps with the object between the pads and with the width of the object."""
    return float(np.mean([_closes(pose, width, request) for pose, width in zip(poses, widths)]))


def _closes(pose: np.ndarray, width: float, request: GraspRequest) -> bool:
    """Returns whether the pads of a grasp close on the object.

    The width is at least the width of the part of the object between the pads, and at most the width of the object.
    """
    local = (request.target.points - pose[:3, 3]) @ pose[:3, :3]
    pad = request.gripper
    inside = (np.abs(local[:, 1]) <= pad.pad_width / 2) & (np.abs(local[:, 2]) <= pad.pad_height / 2)
    if not inside.any() or np.abs(local[inside, 0]).max() > pad.max_opening / 2:
        return False
    return bool(np.ptp(local[inside, 0]) - WIDTH_TOLERANCE_M <= width <= np.ptp(local[:, 0]) + WIDTH_TOLERANCE_M)


def _closing_hint(grasps: Grasps, request: GraspRequest) -> str:
    """Returns the corrections after which the pads close on the object; "" for none."""
    rotations, widths = grasps.poses[:, :3, :3], grasps.widths
    x, y, z = np.moveaxis(rotations, -1, 0)
    corrections = {
        "the widths seem to be half widths": (rotations, 2 * widths),
        "x and y of the hand seem to be exchanged": (np.stack([-y, x, z], axis=-1), widths),
        "the approach direction seems to be x": (np.stack([y, z, x], axis=-1), widths),
        "the approach direction seems to be y": (np.stack([z, x, y], axis=-1), widths),
        "the rotations seem to be inverted": (np.transpose(rotations, (0, 2, 1)), widths),
        "a quaternion seems to have the order w, x, y, z instead of x, y, z, w": (_reordered(rotations, -1), widths),
        "a quaternion seems to have the order x, y, z, w instead of w, x, y, z": (_reordered(rotations, 1), widths),
    }
    suitable = []
    for text, (corrected, corrected_widths) in corrections.items():
        poses = grasps.poses.copy()
        poses[:, :3, :3] = corrected
        if _fraction_closing(poses, corrected_widths, request) >= SUGGESTED_FRACTION:
            suitable.append(text)
    return f"; {', or '.join(suitable)}" if suitable else ""


def _reordered(rotations: np.ndarray, shift: int) -> np.ndarray:
    """Returns the rotations after a shift of the elements x, y, z, w of their quaternions."""
    return np.array([_rotation(np.roll(_quaternion(rotation), shift)) for rotation in rotations])


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    """Returns the unit quaternion x, y, z, w of a rotation matrix: the eigenvector of Bar-Itzhack's matrix (2000)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    matrix = np.array(
        [
            [xx - yy - zz, yx + xy, zx + xz, zy - yz],
            [yx + xy, yy - xx - zz, zy + yz, xz - zx],
            [zx + xz, zy + yz, zz - xx - yy, yx - xy],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    return np.asarray(np.linalg.eigh(matrix)[1][:, -1])


def _rotation(quaternion: np.ndarray) -> np.ndarray:
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _path_hint(positions: Any, request: PathRequest) -> str:
    """Returns the likely reason why a path does not reach start and goal; "" for none."""
    if not isinstance(positions, np.ndarray) or positions.ndim != 2 or not len(positions):
        return ""
    if positions.shape[1] != len(request.start):
        return ""
    first, last = positions[0], positions[-1]
    if _near(np.radians(first), request.start) and not _near(first, request.start):
        return "; the path seems to be in degrees, it must be in radians"
    if _near(last, request.start) and any(_near(first, goal) for goal in request.goals):
        return "; the path seems to begin at the goal"
    if _near(np.sort(first), np.sort(request.start)) and not _near(first, request.start):
        return f"; the joints seem to have another order, it must be {', '.join(request.joint_names)}"
    return ""


def _near(first: np.ndarray, second: np.ndarray) -> bool:
    return bool(np.abs(first - second).max() <= END_TOLERANCE)


def _start(observation: Observation) -> np.ndarray:
    """Returns the positions of all columns of the actions."""
    has_gripper = observation.actions.names[-1] == GRIPPER_COLUMN
    return np.append(observation.robot.positions, [observation.gripper] if has_gripper else [])


def _displacement_faults(actions: np.ndarray, spec: ActionSpec) -> list[str]:
    """Returns the likely faults in the units of end-effector deltas."""
    faults = []
    for what, columns, limit, unit in (
        ("moves", slice(0, 3), MAX_SPEED_M_S, "m"),
        ("turns", slice(3, 6), MAX_TURN_RAD_S, "rad"),
    ):
        speed = np.linalg.norm(actions[:, columns], axis=1).max(initial=0.0) * spec.rate_hz
        if speed > limit:
            faults.append(f"an action {what} the end effector at {speed:.4g} {unit}/s; the columns must be in {unit}")
    return faults


def _action_hint(actions: np.ndarray, observation: Observation) -> str:
    """Returns the likely reason why actions exceed the limits; "" for none."""
    spec, joints = observation.actions, len(observation.actions.joint_names)
    in_radians = actions.copy()
    in_radians[:, :joints] = np.radians(in_radians[:, :joints])
    if not limited_targets(in_radians, spec, _start(observation)).fault:
        return "; the joint columns seem to be in degrees, they must be in radians"
    suitable = [
        kind
        for kind in JOINT_KINDS
        if not limited_targets(actions, replace(spec, kind=kind), _start(observation)).fault
    ]
    return f"; the actions seem to be {' or '.join(suitable)}, they must be {spec.kind}" if suitable else ""
