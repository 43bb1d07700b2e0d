# SPDX-License-Identifier: BSD-3-Clause
"""The visible scene as JSON: what its models look like, and where their links are, for viewers in other processes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose, normalised_quaternion

LinkPoses = tuple[Pose, ...]


@dataclass(frozen=True, slots=True)
class VisibleLink:
    """A link that can be seen.

    Attributes:
        name: Of the link.
        visuals: Its visual shapes.
    """

    name: str
    visuals: tuple[specs.Visual, ...]


@dataclass(frozen=True, slots=True)
class VisibleModel:
    """A model that can be seen.

    Attributes:
        number: Of the model: another one that is spawned later under the same name has another number.
        name: Instance name.
        links: Those with visual shapes.
    """

    number: int
    name: str
    links: tuple[VisibleLink, ...]


@dataclass(frozen=True, slots=True)
class ScenePoses:
    """Where everything is at one instant.

    Attributes:
        time_ns: Simulated time [ns].
        paused: Whether time is paused.
        poses: Poses of the links in the world, in the order of `VisibleModel.links`, by the number of the model.
    """

    time_ns: int
    paused: bool
    poses: Mapping[int, LinkPoses]


def models_to_text(models: Sequence[VisibleModel]) -> str:
    """Returns what models look like as JSON; `models_from_text` reads it."""
    records = [
        {
            "number": model.number,
            "name": model.name,
            "links": [
                {"name": link.name, "visuals": [_visual_record(visual) for visual in link.visuals]}
                for link in model.links
            ],
        }
        for model in models
    ]
    return orjson.dumps(records).decode()


def models_from_text(text: str) -> tuple[VisibleModel, ...]:
    """Returns the models that `models_to_text` wrote.

    Raises:
        ValueError: The text is something else.
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
        raise ValueError(f"no list of visible models ({type(error).__name__}: {error})") from None


def poses_to_text(poses: ScenePoses) -> str:
    """Returns poses as JSON, each as x, y, z [m] and a quaternion xyzw; `poses_from_text` reads it."""
    record = {
        "time_ns": poses.time_ns,
        "paused": poses.paused,
        "poses": {str(number): [_pose_record(pose) for pose in links] for number, links in poses.poses.items()},
    }
    return orjson.dumps(record).decode()


def poses_from_text(text: str) -> ScenePoses:
    """Returns the poses that `poses_to_text` wrote.

    Raises:
        ValueError: The text is something else.
    """
    try:
        record = orjson.loads(text)
        poses = {int(number): tuple(map(_pose_from, links)) for number, links in record["poses"].items()}
        return ScenePoses(int(record["time_ns"]), bool(record["paused"]), poses)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"no poses of visible models ({type(error).__name__}: {error})") from None


def _pose_record(pose: Pose) -> tuple[float, ...]:
    return (*pose.position, *pose.quaternion)


def _pose_from(numbers: Sequence[float]) -> Pose:
    x, y, z, qx, qy, qz, qw = _numbers(numbers)
    return Pose((x, y, z), normalised_quaternion((qx, qy, qz, qw)))


def _numbers(values: Sequence[float]) -> tuple[float, ...]:
    numbers = tuple(float(value) for value in values)
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"{list(numbers)} are not all finite")
    return numbers


def _visual_record(visual: specs.Visual) -> dict[str, Any]:
    return {
        "name": visual.name,
        "pose": _pose_record(visual.pose),
        "geometry": _geometry_record(visual.geometry),
        "colour": visual.colour,
        "texture": str(visual.texture) if visual.texture is not None else None,
        "own_materials": visual.own_materials,
    }


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


def _geometry_record(geometry: specs.Geometry) -> dict[str, Any]:
    match geometry:
        case specs.Box(size=size):
            return {"shape": "box", "size": size}
        case specs.Cylinder(radius=radius, length=length):
            return {"shape": "cylinder", "radius": radius, "length": length}
        case specs.Sphere(radius=radius):
            return {"shape": "sphere", "radius": radius}
        case specs.Plane(normal=normal, size=size):
            return {"shape": "plane", "normal": normal, "size": size}
        case specs.Mesh(path=path, scale=scale, submesh=submesh, center=center):
            return {"shape": "mesh", "path": str(path), "scale": scale, "submesh": submesh, "center": center}
    raise TypeError(f"{type(geometry).__name__} is no geometry")


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
            return specs.Mesh(Path(record["path"]), scale, str(record["submesh"]), bool(record["center"]))
        case shape:
            raise ValueError(f"shape '{shape}' is unknown; allowed: box, cylinder, sphere, plane, mesh")


def _vector(values: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = _numbers(values)
    return x, y, z
