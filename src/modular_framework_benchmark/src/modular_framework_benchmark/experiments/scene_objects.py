# SPDX-License-Identifier: BSD-3-Clause
"""Objects that an experiment spawns in the world, with the distribution of their poses."""

from __future__ import annotations

from collections.abc import Mapping as Map
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from modular_framework_benchmark.experiments.distributions import (
    Distribution,
    Fixed,
    generator_of,
    read_distribution,
)
from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_benchmark.experiments.resource_lookup import UnresolvedReference
from modular_framework_benchmark.records.episode_settings import PlacedObject
from modular_framework_core.files.located_yaml import Mapping, Node, kind_of
from modular_framework_core.files.located_yaml import Sequence as ListNode
from modular_framework_core.task_constructor.key_spelling import corrected_keys, renamed_key
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.model_extents import reach
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources, no_packages
from modular_framework_urdf.rotations import rotate_vector

POSE_KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
SURFACE, OLD_SURFACE = "rests_at", "on"
"""Key of the surface height, and its former name, which PyYAML reads and writes as true."""
KEYS = ("model", "name", *POSE_KEYS, SURFACE)
EXAMPLE = "{model: cube, x: [-0.2, 0.2], y: 0.5, rests_at: 0.84}"


@dataclass(frozen=True, slots=True)
class SceneObject:
    """An object that each episode spawns.

    Attributes:
        name: Name of the object in the world.
        model: Model as the episode needs it: a name or an absolute path.
        file: SDF file of the model.
        pose: Distributions of x, y, z [m] and roll, pitch, yaw [rad] in the world frame; without z the object rests on
            a surface.
        surface: Distribution of the surface height [m]; None if z is given.
    """

    name: str
    model: str
    file: Path
    pose: dict[str, Distribution]
    surface: Distribution | None

    def sampled(self, key: tuple[object, ...], index: int) -> PlacedObject:
        """Returns the object with the pose drawn for a trial.

        Args:
            key: Key of the random generator: the experiment's seed, the trial, ...
            index: Index of the object in the list.
        """
        numbers = {
            name: self.pose.get(name, Fixed(0.0)).draw(generator_of(*key, "objects", index, name)) for name in POSE_KEYS
        }
        if self.surface is not None:
            surface = self.surface.draw(generator_of(*key, "objects", index, OLD_SURFACE))
            numbers["z"] = resting_height(self.file, surface, numbers["roll"], numbers["pitch"])
        return PlacedObject(self.name, self.model, **numbers)


@dataclass(frozen=True, slots=True)
class ObjectNodes:
    """An object whose model is not looked up yet.

    Attributes:
        node: Mapping of the file.
        model: Name or path of the model.
        name: Name of the object; None to derive it from the model.
        pose: See `SceneObject`.
        surface: See `SceneObject`.
    """

    node: Mapping
    model: str
    name: str | None
    pose: dict[str, Distribution]
    surface: Distribution | None


def read_objects(reading: Reading, node: Node, key: str) -> list[ObjectNodes] | None:
    """Reads a list of objects, which may be empty; None if the value is no list.

    Args:
        reading: Reader that collects faults and looks up references.
        node: Value in the file.
        key: Name of the key, for faults.
    """
    if not isinstance(node, ListNode):
        reading.faults.add(node.location, f"{key} must be a list such as [{EXAMPLE}], found {kind_of(node)}")
        return None
    return [found for item in node.items if (found := _read_object(item, reading)) is not None]


def _read_object(item: Node, reading: Reading) -> ObjectNodes | None:
    mapping = reading.mapping(item, "each of objects", EXAMPLE)
    if mapping is None:
        return None
    node = corrected_keys(renamed_key(mapping, OLD_SURFACE, SURFACE), KEYS, "the key of an object", reading.faults)
    if "model" not in node.entries:
        reading.faults.add(node.location, f"an object needs a model; add one, such as {EXAMPLE}")
        return None
    if ("z" in node.entries) == (SURFACE in node.entries):
        found = f"both z and {SURFACE}" if "z" in node.entries else f"neither z nor {SURFACE}"
        reading.faults.add(
            node.location,
            f"an object has {found}; allowed: z, the height of its frame [m], or {SURFACE}, the height of the surface "
            "below it [m]",
        )
    pose = {
        key: sampled
        for key in POSE_KEYS
        if key in node.entries and (sampled := read_distribution(node.entries[key], key, reading)) is not None
    }
    surface = read_distribution(node.entries[SURFACE], SURFACE, reading) if SURFACE in node.entries else None
    model = reading.text(node.entries["model"], "model")
    name = reading.name(node.entries["name"], "name") if "name" in node.entries else None
    return None if model is None else ObjectNodes(node, model, name, pose, surface)


def _named_object(found: ObjectNodes, file: Path, taken: set[str], reading: Reading) -> SceneObject:
    """Returns an object with its model's file; adds a fault if another object has the same name.

    Args:
        found: Object of the experiment file.
        file: SDF file of the model.
        taken: Names of the previous objects; the object's name is added.
        reading: Reader that collects faults.
    """
    name = found.name or next(
        free for number in range(1, len(taken) + 2) if (free := f"{file.parent.name}_{number}") not in taken
    )
    if name in taken:
        location = found.node.entries["name"].location
        reading.faults.add(location, f"two objects have the name '{name}'; rename one of them")
    taken.add(name)
    if found.surface is not None:
        try:
            lowest_point(file, 0.0, 0.0)
        except DescriptionError as error:
            reading.faults.add(found.node.entries[SURFACE].location, f"the model has no lowest point: {error}")
    is_path = "/" in found.model or found.model.endswith(".sdf")
    return SceneObject(name, str(file) if is_path else found.model, file, found.pose, found.surface)


def placed_objects(
    nodes: Sequence[ObjectNodes], launch: str, arguments: Map[str, str], reading: Reading
) -> list[SceneObject]:
    """Returns objects with the files of their models, and adds faults.

    Args:
        nodes: Objects of the experiment file.
        launch: Launch file whose description package contains the models.
        arguments: Arguments of the launch file.
        reading: Reader that collects faults.
    """
    taken: set[str] = set()
    objects = []
    for item in nodes:
        try:
            file = reading.resources.model(item.model, launch, arguments, reading.folder)
        except UnresolvedReference as error:
            reading.faults.add(item.node.entries["model"].location, str(error))
            continue
        objects.append(_named_object(item, file, taken, reading))
    return objects


GAP_M = 0.001
"""Clearance between an object and its surface, so that they are not in contact at the start [m]."""


def resting_height(model: Path, surface_m: float, roll_rad: float, pitch_rad: float) -> float:
    """Returns the height of the model frame at which the model stands on a surface [m].

    Args:
        model: SDF file of the model.
        surface_m: Height of the horizontal surface [m].
        roll_rad: Roll angle of the model [rad].
        pitch_rad: Pitch angle of the model [rad].

    Raises:
        DescriptionError: The file is invalid, or has no collision shape.
    """
    return round(surface_m + GAP_M - lowest_point(model, roll_rad, pitch_rad), 6)


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
        raise DescriptionError(str(model), "got no <collision>", "allowed: a model with one; give z instead of on")
    if any(isinstance(shape, specs.Plane) for shape in shapes):
        raise DescriptionError("<collision>", "got a plane", "allowed: a shape of limited size; give z instead of on")
    to_model = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (roll_rad, pitch_rad, 0.0)).inverse()
    return -reach(spec, rotate_vector(to_model.quaternion, (0.0, 0.0, -1.0)))


@lru_cache(maxsize=64)
def _read(model: Path) -> specs.Model:
    try:
        text = model.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DescriptionError(
            str(model), f"got a file that cannot be read ({error})", "allowed: an SDF file"
        ) from error
    return read_model_text(text, str(model), Resources((model.parent.parent,), no_packages))
