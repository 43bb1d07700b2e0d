# SPDX-License-Identifier: BSD-3-Clause
"""Reads the models of SDF documents, with the models inside them and the documents they include."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_conversion import CONVERTED_VERSION, convert
from modular_framework_simulation.models.sdf_frames import SCOPE, FrameTree, InnerModel
from modular_framework_simulation.models.sdf_inertial import read_inertial
from modular_framework_simulation.models.sdf_joints import read_joint
from modular_framework_simulation.models.sdf_resources import NEWEST_VERSION, OLDEST_VERSION, Resources, version_numbers
from modular_framework_simulation.models.sdf_shapes import Reading, read_collisions, read_visuals
from modular_framework_simulation.models.sdf_surface import read_velocity_decay
from modular_framework_simulation.models.sensor_elements import sdf_sensor_elements
from modular_framework_simulation.models.xml_nodes import XmlNode, read_xml

_MAX_DEPTH = 16
_MOST_MODELS = 10_000
"""Of one world: files that include each other many times over would otherwise fill the memory."""


@dataclass(frozen=True, slots=True)
class LoadedModel:
    """A model as its element describes it.

    Attributes:
        spec: The model; its pose is not set yet, as it may be relative to what stands beside it.
        placed: Its frames and its pose.
    """

    spec: specs.Model
    placed: InnerModel


def sdf_version(root: XmlNode) -> tuple[int, ...]:
    """Returns the version of a document.

    Raises:
        DescriptionError: It is no SDF, or of a version that is not read.
    """
    span = f"{_text(OLDEST_VERSION)} to {_text(NEWEST_VERSION)}"
    if root.tag not in ("sdf", "gazebo"):
        raise DescriptionError(root.where, f"the root element is <{root.tag}>", f"allowed: <sdf version='...'>, {span}")
    text = root.attributes.get("version", "")
    version = version_numbers(text)
    if not OLDEST_VERSION <= version <= NEWEST_VERSION:
        raise DescriptionError(root.where, f"got version '{text}'", f"allowed: {span}")
    return version


def converted_version(root: XmlNode) -> tuple[int, ...]:
    """Returns the version of a document, after converting it if it is of one before the oldest that is read as it is.

    Raises:
        DescriptionError: It is no SDF, or of a version that is not read.
    """
    version = sdf_version(root)
    if version < CONVERTED_VERSION:
        convert(root)
        return CONVERTED_VERSION
    return version


def _text(version: tuple[int, ...]) -> str:
    return ".".join(str(number) for number in version)


class SdfModels:
    """Reads models; one instance reads everything of one world or one request.

    Args:
        resources: Where included models and meshes are found.
    """

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._documents: dict[Path, XmlNode] = {}
        self._models = 0

    def in_document(self, root: XmlNode, depth: int = 0, static: bool | None = None) -> LoadedModel | None:
        """Reads the first model of a document.

        Args:
            root: Its root element.
            depth: How many models and includes it is in.
            static: What overrides the <static> of the model.

        Returns:
            None where the document holds only a light or an actor, which have no body.

        Raises:
            DescriptionError: It holds nothing at all, or something that cannot be used.
        """
        version = converted_version(root)
        holder = root.find("world") or root
        model = holder.find("model")
        if model is not None:
            return self.model(model, version, depth, static)
        include = holder.find("include")
        if include is not None:
            return self.included(include, depth, static)
        if root.find("light") is not None or root.find("actor") is not None:
            return None
        raise DescriptionError(root.where, "holds no <model>", "one <model> or <include> is needed")

    def included(self, node: XmlNode, depth: int, static: bool | None = None) -> LoadedModel | None:
        """Reads the model that an <include> names, with the name, pose and static of the <include>.

        Raises:
            DescriptionError: There is no such model, or something in it cannot be used.
        """
        self._require_shallow(node, depth)
        if node.attributes.get("merge", "false").strip().lower() in ("true", "1"):
            raise DescriptionError(
                node.where, "asks for merge='true'", "allowed: includes that stay models; flatten it"
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
            node: The element.
            version: Of SDF, of its document.
            depth: How many models and includes it is in.
            static: What overrides its <static>.

        Raises:
            DescriptionError: Something in it cannot be used.
        """
        self._require_shallow(node, depth)
        static_node = node.find("static")
        if static is None:
            static = static_node.flag() if static_node is not None else False
        reading = Reading(self._resources, version)
        reading.notes.read_over(node)
        inner = self._inner_models(node, version, depth, True if static else None)
        own_links = node.find_all("link")
        canonical = node.attributes.get("canonical_link") or next((link.name() for link in own_links), "")
        frames = FrameTree(node, {name: each.placed for name, each in inner.items()}, canonical)
        frames.refuse_circles()
        links = [_read_link(link, frames, static, reading) for link in own_links]
        joints = [read_joint(joint, frames, version) for joint in node.find_all("joint")]
        sensors = list(sdf_sensor_elements(node, frames))
        for name, each in inner.items():
            _add_inner(name, each.spec, frames.pose_in_model(name), links, joints, fasten=not static)
            reading.notes.add_lines(each.spec.notes)
            sensors += [_scoped_sensor(sensor, name) for sensor in each.spec.sensors]
        if not links:
            raise DescriptionError(node.where, "has no <link>", "a model needs at least one")
        _refuse_repeated(own_links + node.find_all("joint"))
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
                loaded = self.included(child, depth + 1, static)
            if loaded is None:
                continue
            if loaded.spec.name in inner:
                raise DescriptionError(child.where, f"is a second model '{loaded.spec.name}'", "give each its own name")
            inner[loaded.spec.name] = loaded
        return inner

    def _document(self, path: Path) -> XmlNode:
        if path not in self._documents:
            self._documents[path] = read_xml(path)
        return self._documents[path]

    def _require_shallow(self, node: XmlNode, depth: int) -> None:
        if depth >= _MAX_DEPTH:
            raise DescriptionError(node.where, f"is the model number {depth + 1} inside each other", "break the circle")
        self._models += node.tag == "model"
        if self._models > _MOST_MODELS:
            raise DescriptionError(node.where, f"is the model number {self._models:,}", f"allowed: {_MOST_MODELS:,}")


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
    name: str, inner: specs.Model, pose: Pose, links: list[specs.Link], joints: list[specs.Joint], fasten: bool
) -> None:
    """Adds links and joints of an inner model to those of the outer one."""

    def scoped(link: str) -> str:
        return link if link == specs.WORLD else f"{name}{SCOPE}{link}"

    for link in inner.links:
        links.append(dataclasses.replace(link, name=scoped(link.name), pose=pose @ link.pose))
        if inner.static and fasten:
            joints.append(
                specs.Joint(
                    f"{scoped(link.name)}{SCOPE}static",
                    specs.JointType.FIXED,
                    specs.WORLD,
                    scoped(link.name),
                    Pose(),
                    (0.0, 0.0, 1.0),
                    0.0,
                    0.0,
                )
            )
    for joint in inner.joints if not inner.static else ():
        parent, child = scoped(joint.parent), scoped(joint.child)
        joints.append(dataclasses.replace(joint, name=scoped(joint.name), parent=parent, child=child))


def _scoped_sensor(sensor: specs.SensorElement, inner: str) -> specs.SensorElement:
    """Returns a sensor of an inner model as one of the outer model."""
    link, joint = (f"{inner}{SCOPE}{name}" if name else "" for name in (sensor.link, sensor.joint))
    return dataclasses.replace(sensor, link=link, joint=joint, scope=f"{inner}{SCOPE}{sensor.scope}")


def _refuse_repeated(nodes: list[XmlNode]) -> None:
    seen: set[tuple[str, str]] = set()
    for node in nodes:
        key = (node.tag, node.name())
        if key in seen:
            raise DescriptionError(node.where, f"is not the only {node.tag} of that name", "give each its own name")
        seen.add(key)
