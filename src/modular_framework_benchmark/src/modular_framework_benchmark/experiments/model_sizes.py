# SPDX-License-Identifier: BSD-3-Clause
"""Sizes and joints of models: side lengths of bounding boxes, height of a model on a surface, movable joints."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.model_extents import bounding_box, reach
from modular_framework_simulation.models.model_variants import read_scaled
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_elements import unknown_content
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources, no_packages
from modular_framework_simulation.models.xml_nodes import read_xml
from modular_framework_urdf.rotations import rotate_vector

GAP_M = 0.001
"""Clearance between an object and its surface, so that they are not in contact at the start [m]."""


MAX_LINES = 5
"""Maximum number of lines about a file in a fault."""


def listed_lines(lines: Sequence[str]) -> str:
    """Returns the first lines as text, and the number of further lines."""
    more = [f"{len(lines) - MAX_LINES} more"] if len(lines) > MAX_LINES else []
    return "; ".join([*lines[:MAX_LINES], *more])


@lru_cache(maxsize=64)
def unknown_content_of_file(model: Path) -> tuple[str, ...]:
    """Returns the elements and attributes in a model's file that SDF does not define; empty for an unreadable file."""
    try:
        return unknown_content(read_xml(model))
    except DescriptionError:
        return ()


def resting_height(model: Path, surface_m: float, roll_rad: float, pitch_rad: float, scale: float = 1.0) -> float:
    """Returns the height of the model frame at which the model stands on a surface [m].

    Args:
        model: SDF file of the model.
        surface_m: Height of the horizontal surface [m].
        roll_rad: Roll angle of the model [rad].
        pitch_rad: Pitch angle of the model [rad].
        scale: Factor of the model's lengths.

    Raises:
        DescriptionError: The file is invalid, or has no collision shape.
    """
    return round(surface_m + GAP_M - scale * lowest_point(model, roll_rad, pitch_rad), 6)


@lru_cache(maxsize=64)
def sides(model: Path) -> tuple[float, float, float]:
    """Returns the lengths of the bounding box of a model's collision shapes along x, y and z [m].

    Args:
        model: SDF file of the model.

    Raises:
        DescriptionError: The file is invalid, or has no collision shape.
    """
    box = bounding_box(_read(model))
    if box is None:
        raise DescriptionError(str(model), "got no <collision>", "allowed: a model with one")
    (low_x, low_y, low_z), (high_x, high_y, high_z) = box
    return high_x - low_x, high_y - low_y, high_z - low_z


def longest_side(model: Path) -> float:
    """Returns the longest side of the bounding box of a model that can be scaled [m].

    Raises:
        DescriptionError: See `sides`; or the model has parts that cannot be scaled.
    """
    _check_scalable(model)
    return max(sides(model))


@lru_cache(maxsize=64)
def _check_scalable(model: Path) -> None:
    read_scaled(model, 1.0)


@lru_cache(maxsize=4096)
def lowest_point(model: Path, roll_rad: float, pitch_rad: float) -> float:
    """Returns the height of the lowest point of a model's collision shapes relative to its frame [m].

    Args:
        model: SDF file of the model.
        roll_rad: Roll angle of the model [rad].
        pitch_rad: Pitch angle of the model [rad].

    Raises:
        DescriptionError: See `resting_height`.
    """
    spec = _read(model)
    shapes = [collision.geometry for link in spec.links for collision in link.collisions]
    if not shapes:
        raise DescriptionError(
            str(model), "got no <collision>", "allowed: a model with one; give z instead of rests_at"
        )
    if any(isinstance(shape, specs.Plane) for shape in shapes):
        raise DescriptionError(
            "<collision>", "got a plane", "allowed: a shape of limited size; give z instead of rests_at"
        )
    to_model = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (roll_rad, pitch_rad, 0.0)).inverse()
    return -reach(spec, rotate_vector(to_model.quaternion, (0.0, 0.0, -1.0)))


def movable_joints(model: specs.Model) -> tuple[str, ...]:
    """Returns the names of the joints whose position the simulation records; empty for a static model."""
    recorded = (specs.JointType.REVOLUTE, specs.JointType.CONTINUOUS, specs.JointType.PRISMATIC)
    return tuple(joint.name for joint in model.joints if joint.kind in recorded and not model.static)


def joints_of_file(model: Path) -> tuple[str, ...] | None:
    """Returns the names of a model's movable joints; None if the file cannot be read.

    Args:
        model: SDF file of the model.
    """
    try:
        return movable_joints(_read(model))
    except DescriptionError:
        return None


@lru_cache(maxsize=64)
def _read(model: Path) -> specs.Model:
    try:
        text = model.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DescriptionError(
            str(model), f"got a file that cannot be read ({error})", "allowed: an SDF file"
        ) from error
    return read_model_text(text, str(model), Resources((model.parent.parent,), no_packages))
