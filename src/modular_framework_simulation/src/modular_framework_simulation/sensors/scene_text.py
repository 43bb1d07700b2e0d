# SPDX-License-Identifier: BSD-3-Clause
"""Serializes the visible scene as JSON for viewers in other processes: visual shapes and link poses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import orjson

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose, normalised_quaternion

LinkPoses = tuple[Pose, ...]


@dataclass(frozen=True, slots=True)
class VisibleLink:
    """A link with visual shapes.

    Attributes:
        name: Name of the link.
        visuals: Visual shapes of the link.
    """

    name: str
    visuals: tuple[specs.Visual, ...]


@dataclass(frozen=True, slots=True)
class VisibleModel:
    """A model with visual shapes.

    Attributes:
        number: Unique number of the model; a model that is spawned later under the same name has another number.
        name: Name of the model in the world.
        links: Links with visual shapes.
    """

    number: int
    name: str
    links: tuple[VisibleLink, ...]


@dataclass(frozen=True, slots=True)
class ScenePoses:
    """Poses of all visible links at one instant.

    Attributes:
        time_ns: Simulated time [ns].
        paused: Whether simulated time is paused.
        poses: Link poses in the world frame, in the order of `VisibleModel.links`, by model number.
    """

    time_ns: int
    paused: bool
    poses: Mapping[int, LinkPoses]


def models_to_text(models: Sequence[VisibleModel]) -> str:
    """Serializes the visual shapes of models as JSON for `models_from_text`."""
    return _json_text(models)


def models_from_text(text: str) -> tuple[VisibleModel, ...]:
    """Parses the output of `models_to_text`.

    Raises:
        ValueError: The text is not a list of visible models.
    """
    try:
        return tuple(
            VisibleModel(
                int(model["number"]),
                str(model["name"]),
                tuple(
                    VisibleLink(str(link["name"]), tuple(_visual_from(record) for record in link["visuals"]))
                    for link in model["links"]
                ),
            )
            for model in orjson.loads(text)
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"not a list of visible models ({type(error).__name__}: {error})") from None


def poses_to_text(poses: ScenePoses) -> str:
    """Serializes link poses as JSON for `poses_from_text`, each pose as x, y, z [m] and a quaternion xyzw."""
    return _json_text(poses)


def poses_from_text(text: str) -> ScenePoses:
    """Parses the output of `poses_to_text`.

    Raises:
        ValueError: The text does not contain poses of visible models.
    """
    try:
        record = orjson.loads(text)
        poses = {int(number): tuple(map(_pose_from, links)) for number, links in record["poses"].items()}
        return ScenePoses(int(record["time_ns"]), bool(record["paused"]), poses)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"not the poses of visible models ({type(error).__name__}: {error})") from None


def _json_text(value: Any) -> str:
    return orjson.dumps(value, _json_value, orjson.OPT_PASSTHROUGH_DATACLASS | orjson.OPT_NON_STR_KEYS).decode()


def _json_value(value: Any) -> Any:
    """Converts a path to text, a pose to x, y, z and a quaternion xyzw, and any other dataclass to a mapping."""
    match value:
        case Path():
            return str(value)
        case Pose():
            return (*value.position, *value.quaternion)
    record = {field.name: getattr(value, field.name) for field in fields(value)}
    return {"shape": type(value).__name__.lower(), **record} if isinstance(value, specs.Geometry) else record


def _pose_from(numbers: Sequence[float]) -> Pose:
    x, y, z, qx, qy, qz, qw = _numbers(numbers)
    return Pose((x, y, z), normalised_quaternion((qx, qy, qz, qw)))


def _numbers(values: Sequence[float]) -> tuple[float, ...]:
    numbers = tuple(float(value) for value in values)
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"{list(numbers)} are not all finite")
    return numbers


def _visual_from(record: Mapping[str, Any]) -> specs.Visual:
    red, green, blue, alpha = _numbers(record["colour"])
    texture = record["texture"]
    return specs.Visual(
        str(record["name"]),
        _pose_from(record["pose"]),
        _geometry_from(record["geometry"]),
        (red, green, blue, alpha),
        Path(texture) if texture is not None else None,
        bool(record["own_materials"]),
    )


def _geometry_from(record: Mapping[str, Any]) -> specs.Geometry:
    match record["shape"]:
        case "box":
            return specs.Box(_vector(record["size"]))
        case "cylinder":
            return specs.Cylinder(float(record["radius"]), float(record["length"]))
        case "sphere":
            return specs.Sphere(float(record["radius"]))
        case "plane":
            width, height = _numbers(record["size"])
            return specs.Plane(_vector(record["normal"]), (width, height))
        case "mesh":
            scale = _vector(record["scale"])
            part, location = str(record["submesh"]), str(record.get("location", ""))
            return specs.Mesh(Path(record["path"]), scale, part, bool(record["center"]), location)
        case shape:
            raise ValueError(f"unknown shape '{shape}'; allowed: box, cylinder, sphere, plane, mesh")


def _vector(values: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = _numbers(values)
    return x, y, z
