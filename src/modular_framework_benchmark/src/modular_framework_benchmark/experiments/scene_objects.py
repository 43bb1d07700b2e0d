# SPDX-License-Identifier: BSD-3-Clause
"""Objects that an experiment spawns in the world, with the distribution of their poses."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Sequence
from collections.abc import Mapping as Map
from dataclasses import dataclass, field, replace
from pathlib import Path

from modular_framework_benchmark.experiments.distributions import (
    Choice,
    Distribution,
    generator_of,
    read_distribution,
)
from modular_framework_benchmark.experiments.model_sizes import (
    listed_lines,
    longest_side,
    lowest_point,
    resting_height,
    sides,
    unknown_content_of_file,
)
from modular_framework_benchmark.experiments.reading import ExperimentFault, Reading
from modular_framework_benchmark.experiments.resource_lookup import UnresolvedReference
from modular_framework_benchmark.records.episode_settings import PlacedObject
from modular_framework_benchmark.records.perturbation import ObjectPerturbation, Perturbation
from modular_framework_core.files.faults import Fault, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node, kind_of
from modular_framework_core.files.located_yaml import Sequence as ListNode
from modular_framework_core.task_constructor.key_spelling import corrected_keys, renamed_key
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.model_variants import changed_model, read_scaled

POSE_KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
SURFACE, OLD_SURFACE = "rests_at", "on"
"""Key of the surface height, and its former name, which PyYAML reads and writes as true."""
COUNT, SIZE, SPACING = "count", "size", "spacing"
KEYS = ("model", "name", *POSE_KEYS, SURFACE, COUNT, SIZE, SPACING)
MAX_COUNT, MAX_SIZE_M, MAX_SPACING_M = 50, 2.0, 10.0
MAX_DRAWS, MAX_SCENES = 200, 5
"""Maximum number of poses drawn for an object, and of scenes begun, before objects count as too many for their
ranges."""
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
        size: Distribution of the length of the longest side [m]; None for the size of the model file.
        spacing_m: Smallest horizontal distance between the object's frame and the frames of the objects before it [m].
        node: Mapping of the file, for faults.
        perturbation: Values of the perturbed axes.
    """

    name: str
    model: str
    file: Path
    pose: dict[str, Distribution]
    surface: Distribution | None
    size: Distribution | None = None
    spacing_m: float = 0.0
    node: Mapping | None = field(default=None, compare=False, repr=False)
    perturbation: Perturbation = Perturbation()

    @property
    def diagonal_m(self) -> float:
        """Returns the largest possible diagonal of the object's horizontal sides [m]."""
        scale = 1.0 if self.size is None else self.size.high / longest_side(self.file)
        return scale * self.perturbation.object_size * math.hypot(*sides(self.file)[:2])

    def sample(self, key: tuple[object, ...], index: int, draw: int = 0) -> PlacedObject:
        """Returns the object with the pose, the size and the perturbation drawn for a trial.

        Args:
            key: Key of the random generator: the experiment's seed, the trial, ...
            index: Index of the object in the list.
            draw: Index of the draw, if earlier draws were too near to other objects.
        """
        key = (*key, "objects", index, *((draw,) if draw else ()))
        numbers = {name: self.pose.get(name, Choice((0.0,))).draw(generator_of(*key, name)) for name in POSE_KEYS}
        scale = self._scale(key)
        if self.surface is not None:
            surface = self.surface.draw(generator_of(*key, OLD_SURFACE))
            numbers["z"] = resting_height(self.file, surface, numbers["roll"], numbers["pitch"], scale or 1.0)
        return PlacedObject(self.name, self.model, scale=scale, perturbed=self._drawn_perturbation(key), **numbers)

    def _scale(self, key: tuple[object, ...]) -> float | None:
        """Returns the factor of the model's lengths; None for the size of the model file."""
        perturbed = self.perturbation.object_size
        if self.size is None:
            return None if perturbed == 1.0 else perturbed
        return round(perturbed * self.size.draw(generator_of(*key, SIZE)) / longest_side(self.file), 6)

    def _drawn_perturbation(self, key: tuple[object, ...]) -> ObjectPerturbation | None:
        """Returns the perturbation that the world applies besides the scale; None for none."""
        values, error = self.perturbation, (0.0, 0.0)
        if distance_m := values.perceived_pose_error:
            direction_rad = generator_of(*key, "pose_error").uniform(-math.pi, math.pi)
            error = (round(distance_m * math.cos(direction_rad), 9), round(distance_m * math.sin(direction_rad), 9))
        perturbation = ObjectPerturbation(
            mass=values.object_mass,
            friction=values.object_friction,
            centre_of_mass=values.object_centre_of_mass,
            pose_error=error,
        )
        return None if perturbation == ObjectPerturbation() else perturbation

    def is_clear_of(self, placed: PlacedObject, others: Sequence[PlacedObject]) -> bool:
        """Returns whether the object keeps its spacing.

        Args:
            placed: The object at its pose.
            others: Objects before it.
        """
        return all(math.hypot(placed.x - other.x, placed.y - other.y) >= self.spacing_m for other in others)


def sampled_scene(objects: Sequence[SceneObject], key: tuple[object, ...]) -> tuple[PlacedObject, ...]:
    """Returns the objects of a trial with their poses.

    A pose that is too near to the objects before it is drawn again. If no pose is found, all objects are drawn again.

    Args:
        objects: Objects in their order.
        key: Key of the random generator: the experiment's seed, the trial, ...

    Raises:
        ExperimentFault: The objects do not fit into their ranges.
    """
    failed = objects[0] if objects else None
    for scene in range(MAX_SCENES):
        placed: list[PlacedObject] = []
        for index, item in enumerate(objects):
            draws = (item.sample(key, index, scene * MAX_DRAWS + draw) for draw in range(MAX_DRAWS))
            clear_object = next((drawn for drawn in draws if item.is_clear_of(drawn, placed)), None)
            if clear_object is None:
                failed = item
                break
            placed.append(clear_object)
        else:
            return tuple(placed)
    assert failed is not None and failed.node is not None
    raise ExperimentFault([Fault(failed.node.location, _crowding_fault(failed, objects))])


def _crowding_fault(failed: SceneObject, objects: Sequence[SceneObject]) -> str:
    before = list(itertools.takewhile(lambda item: item is not failed, objects))
    return (
        f"object '{failed.name}' does not fit: no pose in {MAX_DRAWS * MAX_SCENES} draws is {failed.spacing_m:g} m "
        f"from the {len(before)} objects before it; choose wider ranges of x and y, a smaller {SPACING}, or fewer "
        "objects"
    )


@dataclass(frozen=True, slots=True)
class ObjectNodes:
    """An object whose model is not looked up yet.

    Attributes:
        node: Mapping of the file.
        model: Name or path of the model.
        name: Name of the object; None to derive it from the model.
        pose: See `SceneObject`.
        surface: See `SceneObject`.
        size: See `SceneObject`.
        spacing_m: See `SceneObject`.
        count: Number of objects, named NAME_1, NAME_2, ...; None for one object of the given name.
    """

    node: Mapping
    model: str
    name: str | None
    pose: dict[str, Distribution]
    surface: Distribution | None
    size: Distribution | None = None
    spacing_m: float = 0.0
    count: int | None = None


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
    return [nodes for item in node.items if (nodes := _read_object(item, reading)) is not None]


def _read_object(item: Node, reading: Reading) -> ObjectNodes | None:
    mapping = reading.mapping(item, "each of objects", EXAMPLE)
    if mapping is None:
        return None
    node = corrected_keys(renamed_key(mapping, OLD_SURFACE, SURFACE), KEYS, "the key of an object", reading.faults)
    if "model" not in node.entries:
        reading.faults.add(node.location, f"an object needs a model; add one, such as {EXAMPLE}")
        return None
    if ("z" in node.entries) == (SURFACE in node.entries):
        keys = f"both z and {SURFACE}" if "z" in node.entries else f"neither z nor {SURFACE}"
        reading.faults.add(
            node.location,
            f"an object has {keys}; allowed: z, the height of its frame [m], or {SURFACE}, the height of the surface "
            "below it [m]",
        )
    pose = {
        key: sampled
        for key in POSE_KEYS
        if key in node.entries and (sampled := read_distribution(node.entries[key], key, reading)) is not None
    }
    surface, size = (
        read_distribution(node.entries[key], key, reading) if key in node.entries else None for key in (SURFACE, SIZE)
    )
    if size is not None and not 0.0 < size.low <= size.high <= MAX_SIZE_M:
        text = f"size is {size.low:g} to {size.high:g} m; allowed: more than 0, up to {MAX_SIZE_M:g} m"
        reading.faults.add(node.entries[SIZE].location, text)
        size = None
    spacing = reading.number(node.entries[SPACING], SPACING, 0.0, MAX_SPACING_M) if SPACING in node.entries else 0.0
    count = reading.count(node.entries[COUNT], COUNT, 1, MAX_COUNT) if COUNT in node.entries else None
    model = reading.text(node.entries["model"], "model")
    name = reading.name(node.entries["name"], "name") if "name" in node.entries else None
    if model is None or spacing is None or (count is None and COUNT in node.entries):
        return None
    return ObjectNodes(node, model, name, pose, surface, size, spacing, count)


def _named_objects(
    nodes: ObjectNodes, file: Path, taken_names: set[str], reading: Reading, world: Collection[str]
) -> list[SceneObject]:
    """Returns objects with their model's file; adds a fault if another object has the same name.

    Args:
        nodes: Objects of one model in the experiment file.
        file: SDF file of the model.
        taken_names: Names of the previous objects; the names of the objects are added.
        reading: Reader that collects faults.
        world: Names of the models of the world.
    """
    base = nodes.name or file.parent.name
    if nodes.count is not None:
        names = [f"{base}_{number}" for number in range(1, nodes.count + 1)]
    elif nodes.name:
        names = [nodes.name]
    else:
        numbered = (f"{base}_{number}" for number in range(1, len(taken_names) + len(world) + 2))
        names = [next(free for free in numbered if free not in taken_names and free not in world)]
    if repeated_names := taken_names.intersection(names):
        location = nodes.node.entries.get("name", nodes.node).location
        reading.faults.add(location, f"two objects have the name '{min(repeated_names)}'; rename one of them")
    if world_names := set(world).intersection(names):
        location = nodes.node.entries.get("name", nodes.node).location
        text = f"the world has a model '{min(world_names)}' already; give the object another name"
        reading.faults.add(location, text)
    taken_names.update(names)
    is_path = "/" in nodes.model or nodes.model.endswith(".sdf")
    objects = [
        SceneObject(
            name,
            str(file) if is_path else nodes.model,
            file,
            nodes.pose,
            nodes.surface,
            nodes.size,
            nodes.spacing_m,
            nodes.node,
        )
        for name in names
    ]
    _check_model(nodes.node, objects, reading)
    return objects


def _check_model(node: Mapping, objects: Sequence[SceneObject], reading: Reading) -> None:
    """Adds a fault if the model cannot rest on a surface, have a size, or stand beside others of its kind."""
    file = objects[0].file
    if unknown := unknown_content_of_file(file):
        reading.faults.add(node.entries["model"].location, f"the model has unknown content: {listed_lines(unknown)}")
    checks: dict[str, Callable[[], object]] = {
        SURFACE: lambda: lowest_point(file, 0.0, 0.0),
        SIZE: lambda: longest_side(file),
        COUNT: lambda: _check_spacing(objects, node.entries.get(SPACING, node).location, reading),
    }
    for key, check in checks.items():
        if key in node.entries:
            try:
                check()
            except DescriptionError as error:
                what = {SURFACE: "has no lowest point", SIZE: "cannot have a size"}.get(key, "has no extent")
                reading.faults.add(node.entries[key].location, f"the model {what}: {error}")


def _check_spacing(objects: Sequence[SceneObject], location: SourceLocation, reading: Reading) -> None:
    """Adds a fault if several objects of a model could overlap."""
    first, size = objects[0], objects[0].perturbation.object_size
    if len(objects) > 1 and first.spacing_m < first.diagonal_m:
        model = "the model" if size == 1.0 else f"the model with object_size {size:g}"
        reading.faults.add(
            location,
            f"{len(objects)} objects with a {SPACING} of {first.spacing_m:g} m could overlap; allowed: at least the "
            f"diagonal of {model}, {first.diagonal_m:.3f} m",
        )


def placed_objects(
    nodes: Sequence[ObjectNodes], launch: str, arguments: Map[str, str], reading: Reading, world: Collection[str] = ()
) -> list[SceneObject]:
    """Returns objects with the files of their models, and adds faults.

    Args:
        nodes: Objects of the experiment file.
        launch: Launch file whose description package contains the models.
        arguments: Arguments of the launch file.
        reading: Reader that collects faults.
        world: Names of the models of the world; objects must have different names.
    """
    taken_names: set[str] = set()
    objects: list[SceneObject] = []
    before = len(reading.faults)
    for item in nodes:
        try:
            file = reading.resources.model(item.model, launch, arguments, reading.folder)
        except UnresolvedReference as error:
            reading.faults.add(item.node.entries["model"].location, str(error))
            continue
        objects += _named_objects(item, file, taken_names, reading, world)
    if len(reading.faults) == before and any(item.spacing_m for item in nodes):
        try:
            sampled_scene(objects, ("check",))
        except ExperimentFault as error:
            for fault in error.faults:
                reading.faults.add(fault.location, fault.message)
    return objects


def perturbed_objects(
    objects: Sequence[SceneObject], perturbation: Perturbation, location: SourceLocation, reading: Reading
) -> list[SceneObject]:
    """Returns objects with their perturbation, and adds a fault for each object that cannot be perturbed.

    Args:
        objects: Objects of the experiment.
        perturbation: Values of the perturbed axes.
        location: Location of the perturbation in the file.
        reading: Reader that collects faults.
    """
    perturbed = [replace(item, perturbation=perturbation) for item in objects]
    for _, group in itertools.groupby(perturbed, key=lambda item: id(item.node)):
        same_model = tuple(group)
        try:
            _check_perturbation(same_model, location, reading)
        except (DescriptionError, OSError, ValueError) as error:
            reading.faults.add(location, f"object '{same_model[0].name}' cannot be perturbed: {error}")
    return perturbed


def _check_perturbation(objects: Sequence[SceneObject], location: SourceLocation, reading: Reading) -> None:
    """Checks that objects of one model can be perturbed, and adds a fault if another size has no place.

    Args:
        objects: Perturbed objects of the model.
        location: Location of the perturbation in the file.
        reading: Reader that collects faults.

    Raises:
        DescriptionError: The model cannot be changed.
        OSError: The file of the model cannot be read.
        ValueError: The file of the model has text in place of a number.
    """
    first, values = objects[0], objects[0].perturbation
    is_scaled = values.object_size != 1.0
    text = read_scaled(first.file, values.object_size if is_scaled else None)
    changed_model(
        text,
        str(first.file),
        mass=values.object_mass,
        friction=values.object_friction,
        centre_of_mass=values.object_centre_of_mass,
    )
    if not is_scaled:
        return
    if "z" in first.pose:
        fault = f"object '{first.name}' has z, and in another size it would not rest on its surface"
        reading.faults.add(location, f"{fault}; write {SURFACE} instead of z")
    _check_spacing(objects, location, reading)
