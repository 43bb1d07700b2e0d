# SPDX-License-Identifier: BSD-3-Clause
"""Reads the models of SDF documents, including nested models and included documents."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_conversion import CONVERTED_VERSION, convert
from modular_framework_simulation.models.sdf_elements import unknown_content
from modular_framework_simulation.models.sdf_frames import SCOPE, FrameTree, InnerModel
from modular_framework_simulation.models.sdf_inertial import read_inertial
from modular_framework_simulation.models.sdf_joints import read_joint
from modular_framework_simulation.models.sdf_resources import NEWEST_VERSION, OLDEST_VERSION, Resources, version_numbers
from modular_framework_simulation.models.sdf_shapes import Reading, read_collisions, read_visuals
from modular_framework_simulation.models.sdf_surface import read_velocity_decay
from modular_framework_simulation.models.sensor_elements import sdf_sensor_elements
from modular_framework_simulation.models.xml_nodes import XmlNode, read_xml

_MAX_DEPTH = 16
_MAX_MODELS = 10_000
"""Maximum number of models of a world; files that include each other repeatedly would otherwise exhaust the memory."""


@dataclass(frozen=True, slots=True)
class LoadedModel:
    """Model read from an element.

    Attributes:
        spec: The model, without its pose, which may be relative to a sibling of the element.
        placed: Frames and <pose> of the model.
    """

    spec: specs.Model
    placed: InnerModel


def sdf_version(root: XmlNode) -> tuple[int, ...]:
    """Returns the SDF version of a document.

    Raises:
        DescriptionError: The document is not SDF, or has an unsupported version.
    """
    supported = f"{_text(OLDEST_VERSION)} to {_text(NEWEST_VERSION)}"
    if root.tag not in ("sdf", "gazebo"):
        raise DescriptionError(
            root.location, f"the root element is <{root.tag}>", f"allowed: <sdf version='...'>, {supported}"
        )
    text = root.attributes.get("version", "")
    version = version_numbers(text)
    if not OLDEST_VERSION <= version <= NEWEST_VERSION:
        raise DescriptionError(root.location, f"got version '{text}'", f"allowed: {supported}")
    return version


def converted_version(root: XmlNode) -> tuple[int, ...]:
    """Returns the SDF version of a document, after converting a document older than `CONVERTED_VERSION`.

    Raises:
        DescriptionError: The document is not SDF, or has an unsupported version.
    """
    version = sdf_version(root)
    if version < CONVERTED_VERSION:
        convert(root)
        return CONVERTED_VERSION
    return version


def _text(version: tuple[int, ...]) -> str:
    return ".".join(str(number) for number in version)


class SdfModels:
    """Reader of models, used for a single world or request.

    Args:
        resources: Folders and packages for included models and meshes.

    Attributes:
        unknown: Elements and attributes of included documents that SDF does not define.
    """

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self.unknown: list[str] = []
        self._documents: dict[Path, XmlNode] = {}
        self._models = 0

    def in_document(self, root: XmlNode, depth: int = 0, static: bool | None = None) -> LoadedModel | None:
        """Reads the first model of a document.

        Args:
            root: Root element of the document.
            depth: Nesting depth of models and includes.
            static: Value that overrides the model's <static>; None to keep it.

        Returns:
            The model; None if the document contains only a light or an actor, which have no body.

        Raises:
            DescriptionError: The document has no content, or unsupported or invalid content.
        """
        version = converted_version(root)
        holder = root.find("world") or root
        model = holder.find("model")
        if model is not None:
            return self.model(model, version, depth, static)
        include = holder.find("include")
        if include is not None:
            return self.include_model(include, depth, static)
        if root.find("light") is not None or root.find("actor") is not None:
            return None
        raise DescriptionError(root.location, "contains no <model>", "a <model> or <include> is required")

    def include_model(self, node: XmlNode, depth: int, static: bool | None = None) -> LoadedModel | None:
        """Reads the model of an <include>, and applies the name, pose and static of the <include>.

        Args:
            node: The <include> element.
            depth: Nesting depth of models and includes.
            static: Value that overrides the model's <static>; None to keep it.

        Returns:
            The model; None if the included document contains only a light or an actor.

        Raises:
            DescriptionError: The model does not exist, or has unsupported or invalid content.
        """
        self._require_shallow(node, depth)
        if node.attributes.get("merge", "false").strip().lower() in ("true", "1"):
            raise DescriptionError(
                node.location, "has merge='true'", "allowed: an <include> without merge; copy the model's content"
            )
        uri = node.require("uri").text.strip()
        own_static = node.find("static")
        if own_static is not None and static is None:
            static = own_static.flag()
        loaded = self.in_document(self._document(self._resources.model_file(node, uri)), depth + 1, static)
        if loaded is None:
            return None
        name, pose, placement = node.find("name"), node.find("pose"), node.find("placement_frame")
        spec, placed = loaded.spec, loaded.placed
        if name is not None and name.text.strip():
            spec = dataclasses.replace(spec, name=name.text.strip())
        if pose is not None:
            placed = dataclasses.replace(placed, pose=pose)
        if placement is not None:
            placed = dataclasses.replace(placed, placement_frame=placement.text.strip())
        return LoadedModel(spec, placed)

    def model(self, node: XmlNode, version: tuple[int, ...], depth: int, static: bool | None = None) -> LoadedModel:
        """Reads a <model>.

        Args:
            node: The <model> element.
            version: SDF version of the document.
            depth: Nesting depth of models and includes.
            static: Value that overrides the model's <static>; None to keep it.

        Raises:
            DescriptionError: The model has unsupported or invalid content.
        """
        self._require_shallow(node, depth)
        static_node = node.find("static")
        if static is None:
            static = static_node.flag() if static_node is not None else False
        reading = Reading(self._resources, version)
        reading.notes.note_unsupported(node)
        inner = self._inner_models(node, version, depth, True if static else None)
        own_links = node.find_all("link")
        canonical = node.attributes.get("canonical_link") or next((link.name() for link in own_links), "")
        frames = FrameTree(node, {name: each.placed for name, each in inner.items()}, canonical)
        frames.refuse_circles()
        links = [_read_link(link, frames, static, reading) for link in own_links]
        joints = [read_joint(joint, frames, version) for joint in node.find_all("joint")]
        sensors = list(sdf_sensor_elements(node, frames))
        for name, each in inner.items():
            _add_inner(name, each.spec, frames.pose_in_model(name), links=links, joints=joints, fix_to_world=not static)
            reading.notes.add_lines(each.spec.notes)
            sensors += [_scoped_sensor(sensor, name) for sensor in each.spec.sensors]
        if not links:
            raise DescriptionError(node.location, "has no <link>", "a model needs at least one")
        _refuse_duplicates(own_links + node.find_all("joint"))
        self_collide = node.find("self_collide")
        spec = specs.Model(
            name=node.name(),
            pose=Pose(),
            static=static,
            links=tuple(links),
            joints=tuple(joints),
            source=node.source,
            self_collide=self_collide.flag() if self_collide is not None else False,
            notes=reading.notes.lines,
            sensors=tuple(sensors),
        )
        return LoadedModel(spec, InnerModel(frames, node.find("pose"), node.attributes.get("placement_frame", "")))

    def _inner_models(
        self, node: XmlNode, version: tuple[int, ...], depth: int, static: bool | None
    ) -> dict[str, LoadedModel]:
        inner: dict[str, LoadedModel] = {}
        for child in node.children:
            loaded: LoadedModel | None = None
            if child.tag == "model":
                loaded = self.model(child, version, depth + 1, static)
            elif child.tag == "include":
                loaded = self.include_model(child, depth + 1, static)
            if loaded is None:
                continue
            if loaded.spec.name in inner:
                raise DescriptionError(
                    child.location, f"is a second model '{loaded.spec.name}'", "give each model its own name"
                )
            inner[loaded.spec.name] = loaded
        return inner

    def _document(self, path: Path) -> XmlNode:
        if path not in self._documents:
            self._documents[path] = read_xml(path)
            self.unknown += unknown_content(self._documents[path])
        return self._documents[path]

    def _require_shallow(self, node: XmlNode, depth: int) -> None:
        if depth >= _MAX_DEPTH:
            raise DescriptionError(
                node.location,
                f"has the nesting depth {depth + 1}",
                f"allowed: {_MAX_DEPTH}; break the circle of includes",
            )
        self._models += node.tag == "model"
        if self._models > _MAX_MODELS:
            raise DescriptionError(node.location, f"is model number {self._models:,}", f"allowed: {_MAX_MODELS:,}")


def _read_link(node: XmlNode, frames: FrameTree, static: bool, reading: Reading) -> specs.Link:
    name = node.name()
    collisions = tuple(
        shape for child in node.find_all("collision") for shape in read_collisions(child, name, frames, reading)
    )
    flags = {tag: child.flag() for tag in ("gravity", "kinematic", "self_collide") if (child := node.find(tag))}
    return specs.Link(
        name=name,
        pose=frames.pose_in_model(name),
        inertial=None if static else read_inertial(node, frames, collisions, reading.notes),
        collisions=collisions,
        visuals=tuple(
            shape for child in node.find_all("visual") for shape in read_visuals(child, name, frames, reading)
        ),
        velocity_decay=read_velocity_decay(node),
        gravity=flags.get("gravity", True),
        kinematic=flags.get("kinematic", False),
        self_collide=flags.get("self_collide"),
    )


def _add_inner(
    name: str, inner: specs.Model, pose: Pose, *, links: list[specs.Link], joints: list[specs.Joint], fix_to_world: bool
) -> None:
    """Adds the links and joints of an inner model to the links and joints of the outer model."""

    def scoped_name(link: str) -> str:
        return link if link == specs.WORLD else f"{name}{SCOPE}{link}"

    for link in inner.links:
        links.append(dataclasses.replace(link, name=scoped_name(link.name), pose=pose @ link.pose))
        if inner.static and fix_to_world:
            joints.append(
                specs.Joint(
                    f"{scoped_name(link.name)}{SCOPE}static",
                    specs.JointType.FIXED,
                    specs.WORLD,
                    scoped_name(link.name),
                    pose=Pose(),
                    axis=(0.0, 0.0, 1.0),
                    lower=0.0,
                    upper=0.0,
                )
            )
    for joint in inner.joints if not inner.static else ():
        parent, child = scoped_name(joint.parent), scoped_name(joint.child)
        joints.append(dataclasses.replace(joint, name=scoped_name(joint.name), parent=parent, child=child))


def _scoped_sensor(sensor: specs.SensorElement, inner: str) -> specs.SensorElement:
    """Returns an inner model's sensor as a sensor of the outer model."""
    link, joint = (f"{inner}{SCOPE}{name}" if name else "" for name in (sensor.link, sensor.joint))
    return dataclasses.replace(sensor, link=link, joint=joint, scope=f"{inner}{SCOPE}{sensor.scope}")


def _refuse_duplicates(nodes: list[XmlNode]) -> None:
    seen: set[tuple[str, str]] = set()
    for node in nodes:
        key = (node.tag, node.name())
        if key in seen:
            raise DescriptionError(node.location, f"has the name of another {node.tag}", "give each its own name")
        seen.add(key)
