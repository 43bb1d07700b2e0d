# SPDX-License-Identifier: BSD-3-Clause
"""The objects of an experiment: what is put into the world, and where, in each trial."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from modular_framework_benchmark.experiments.distributions import (
    Distribution,
    Fixed,
    generator_of,
    read_distribution,
)
from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_benchmark.experiments.resting_height import lowest_point, resting_height
from modular_framework_core.files.located_yaml import Mapping, Node, Sequence, kind_of
from modular_framework_core.task_constructor.key_spelling import corrected_keys
from modular_framework_simulation.errors import DescriptionError

POSE_KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
SURFACE, OLD_SURFACE = "rests_at", "on"
"""Key of the height of the surface, and its old name, which PyYAML reads and writes as true."""
KEYS = ("model", "name", *POSE_KEYS, SURFACE)
EXAMPLE = "{model: cube, x: [-0.2, 0.2], y: 0.5, rests_at: 0.84}"


@dataclass(frozen=True, slots=True)
class SceneObject:
    """An object.

    Attributes:
        name: Name of the object in the world.
        model: As the episode needs it: a model's name, or an absolute path.
        file: Its .sdf file.
        pose: Distribution of each of x, y, z [m], roll, pitch, yaw [rad] in the world frame; without z it stands on
            a surface.
        surface: Height of that surface [m]; None with z.
    """

    name: str
    model: str
    file: Path
    pose: dict[str, Distribution]
    surface: Distribution | None

    def drawn(self, key: tuple[object, ...], index: int) -> dict[str, Any]:
        """Returns the object with the pose that it has in a trial.

        Args:
            key: What the draws depend on: the experiment's seed, the trial, ...
            index: Place of the object in the list.
        """
        numbers = {
            name: self.pose.get(name, Fixed(0.0)).draw(generator_of(*key, "objects", index, name)) for name in POSE_KEYS
        }
        if self.surface is not None:
            surface = self.surface.draw(generator_of(*key, "objects", index, OLD_SURFACE))
            numbers["z"] = resting_height(self.file, surface, numbers["roll"], numbers["pitch"])
        return {"name": self.name, "model": self.model, **numbers}


@dataclass(frozen=True, slots=True)
class ObjectNodes:
    """An object before its model was looked up.

    Attributes:
        node: Where it is in the file.
        model: Name of its model, and where that is.
        name: Its own name; None for one made from the model's.
        pose: As of a `SceneObject`.
        surface: As of a `SceneObject`.
    """

    node: Mapping
    model: str
    name: str | None
    pose: dict[str, Distribution]
    surface: Distribution | None


def read_objects(node: Node, reading: Reading) -> list[ObjectNodes] | None:
    """Reads the list of objects, which may be empty."""
    if not isinstance(node, Sequence):
        reading.faults.add(node.location, f"objects must be a list such as [{EXAMPLE}], found {kind_of(node)}")
        return None
    return [found for item in node.items if (found := _read_object(item, reading)) is not None]


def _read_object(item: Node, reading: Reading) -> ObjectNodes | None:
    mapping = reading.mapping(item, "each of objects", EXAMPLE)
    if mapping is None:
        return None
    node = corrected_keys(_renamed(mapping), KEYS, "the key of an object", reading.faults)
    if "model" not in node.entries:
        reading.faults.add(node.location, f"an object needs a model; add one, such as {EXAMPLE}")
        return None
    if ("z" in node.entries) == (SURFACE in node.entries):
        found = f"both z and {SURFACE}" if "z" in node.entries else f"neither z nor {SURFACE}"
        reading.faults.add(
            node.location,
            f"an object has {found}; allowed is one of them: z, the height of its frame, or {SURFACE}, that of the "
            "surface it stands on [m]",
        )
    pose = {
        key: drawn
        for key in POSE_KEYS
        if key in node.entries and (drawn := read_distribution(node.entries[key], key, reading)) is not None
    }
    surface = read_distribution(node.entries[SURFACE], SURFACE, reading) if SURFACE in node.entries else None
    model = reading.text(node.entries["model"], "model")
    name = reading.name(node.entries["name"], "name") if "name" in node.entries else None
    return None if model is None else ObjectNodes(node, model, name, pose, surface)


def _renamed(mapping: Mapping) -> Mapping:
    """Returns the keys of an object with OLD_SURFACE as SURFACE, unless that is there too."""
    if SURFACE in mapping.entries:
        return mapping
    names = {key: SURFACE if key == OLD_SURFACE else key for key in mapping.entries}
    return Mapping(
        {names[key]: value for key, value in mapping.entries.items()},
        {names[key]: location for key, location in mapping.keys.items()},
        mapping.location,
    )


def named_object(found: ObjectNodes, file: Path, taken: set[str], reading: Reading) -> SceneObject:
    """Returns an object whose model was looked up; notes a fault for a name that another object has.

    Args:
        found: The object.
        file: Its .sdf file.
        taken: Names of the objects before it; gets its own.
        reading: Where faults are noted.
    """
    name = found.name or next(
        free for number in range(1, len(taken) + 2) if (free := f"{file.parent.name}_{number}") not in taken
    )
    if name in taken:
        location = found.node.entries["name"].location
        reading.faults.add(location, f"two objects have the name '{name}'; give one of them another name")
    taken.add(name)
    if found.surface is not None:
        try:
            lowest_point(file, 0.0, 0.0)
        except DescriptionError as error:
            reading.faults.add(found.node.entries[SURFACE].location, f"the model's lowest point is not known: {error}")
    is_path = "/" in found.model or found.model.endswith(".sdf")
    return SceneObject(name, str(file) if is_path else found.model, file, found.pose, found.surface)
