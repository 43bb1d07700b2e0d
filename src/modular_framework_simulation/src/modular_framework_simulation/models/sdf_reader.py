# SPDX-License-Identifier: BSD-3-Clause
"""Reads worlds and models written in SDF 1.4 to 1.7.

What is read: includes, poses (with relative_to between links, frames and the model), static models, links with their
inertia, collision and visual shapes, friction, and the joints of simple multi-link models. Sensors, plugins, lights
and settings of other physics engines have no effect here and are ignored.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_frames import FrameTree, pose_of
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.sdf_shapes import (
    SUPPORTED_VERSIONS,
    read_collision,
    read_inertial,
    read_visual,
)
from modular_framework_simulation.models.xml_nodes import XmlNode, parse_xml, read_xml

STANDARD_GRAVITY = (0.0, 0.0, -9.8)
"""SDF's default gravity [m/s^2]."""

_MAX_INCLUDE_DEPTH = 8


def read_world(path: Path, resources: Resources) -> specs.World:
    """Reads a .world file.

    Args:
        path: The file.
        resources: Where included models and meshes are found.

    Returns:
        The world with every include resolved.

    Raises:
        DescriptionError: Something in the file, or in a file it includes, cannot be used.
    """
    world = _sdf_root(read_xml(path)).require("world")
    gravity = world.find("gravity")
    models: list[specs.Model] = []
    ignored: list[str] = []
    for child in world.children:
        if child.tag == "include":
            models.append(_read_include(child, resources, 0))
        elif child.tag == "model":
            models.append(_read_model(child, resources))
        elif child.tag != "gravity":
            ignored.append(f"{child.source}:{child.line}: <{child.tag}>")
    names = [model.name for model in models]
    for name in names:
        if names.count(name) > 1:
            raise DescriptionError(world.where, f"holds {names.count(name)} models '{name}'", "give each its own name")
    acceleration = gravity.numbers(3) if gravity is not None else STANDARD_GRAVITY
    return specs.World(
        world.attributes.get("name", path.stem),
        (acceleration[0], acceleration[1], acceleration[2]),
        tuple(models),
        tuple(ignored),
    )


def read_model_text(text: str, source: str, resources: Resources) -> specs.Model:
    """Reads a model from text, for instance from a spawn request.

    Args:
        text: The SDF.
        source: What to call the text in messages.
        resources: Where included models and meshes are found.

    Raises:
        DescriptionError: Something in it cannot be used.
    """
    return _model_of_document(parse_xml(text, source), resources, 0)


def _sdf_root(root: XmlNode) -> XmlNode:
    if root.tag not in ("sdf", "gazebo"):
        raise DescriptionError(root.where, f"the root element is <{root.tag}>", "allowed: <sdf version='1.4' to '1.7'>")
    version = root.attributes.get("version", "")
    if version not in SUPPORTED_VERSIONS:
        raise DescriptionError(root.where, f"got version '{version}'", f"allowed: {', '.join(SUPPORTED_VERSIONS)}")
    return root


def _model_of_document(document: XmlNode, resources: Resources, depth: int) -> specs.Model:
    root = _sdf_root(document)
    world = root.find("world")
    holder = world if world is not None else root
    model = holder.find("model")
    if model is not None:
        return _read_model(model, resources)
    include = holder.find("include")
    if include is not None:
        return _read_include(include, resources, depth)
    raise DescriptionError(root.where, "holds no <model>", "one <model> or <include> is needed")


def _read_include(node: XmlNode, resources: Resources, depth: int) -> specs.Model:
    if depth >= _MAX_INCLUDE_DEPTH:
        raise DescriptionError(node.where, f"is the include number {depth + 1} inside each other", "break the circle")
    uri = node.require("uri").text.strip()
    model = _model_of_document(read_xml(resources.model_file(node, uri)), resources, depth + 1)
    name, pose, static = node.find("name"), node.find("pose"), node.find("static")
    return dataclasses.replace(
        model,
        name=name.text.strip() if name is not None else model.name,
        pose=pose_of(pose) if pose is not None else model.pose,
        static=static.flag() if static is not None else model.static,
    )


def _read_model(node: XmlNode, resources: Resources) -> specs.Model:
    nested = node.find("model") or node.find("include")
    if nested is not None:
        raise DescriptionError(nested.where, "is a model inside a model", "allowed: links and joints; flatten it")
    link_nodes = node.find_all("link")
    if not link_nodes:
        raise DescriptionError(node.where, "has no <link>", "a model needs at least one")
    frames = FrameTree(node)
    links = tuple(_read_link(link, frames, resources) for link in link_nodes)
    names = [link.name for link in links]
    for link in link_nodes:
        if names.count(link.name()) > 1:
            raise DescriptionError(link.where, "is not the only link of that name", "give each link its own name")
    pose, static = node.find("pose"), node.find("static")
    model = specs.Model(
        name=node.name(),
        pose=pose_of(pose) if pose is not None else Pose(),
        static=static.flag() if static is not None else False,
        links=links,
        joints=tuple(_read_joint(joint, names, frames) for joint in node.find_all("joint")),
        source=node.source,
    )
    _check_tree(node, model)
    return model


def _read_link(node: XmlNode, frames: FrameTree, resources: Resources) -> specs.Link:
    inertial = node.find("inertial")
    return specs.Link(
        name=node.name(),
        pose=frames.pose_in_model(node.name()),
        inertial=read_inertial(inertial) if inertial is not None else None,
        collisions=tuple(read_collision(child, resources) for child in node.find_all("collision")),
        visuals=tuple(read_visual(child, resources) for child in node.find_all("visual")),
    )


def _read_joint(node: XmlNode, links: list[str], frames: FrameTree) -> specs.Joint:
    kind = node.choice("type", specs.JointType, "joint type")
    parent, child = node.require("parent").text.strip(), node.require("child").text.strip()
    for role, name in (("parent", parent), ("child", child)):
        if name not in links and not (role == "parent" and name == "world"):
            raise DescriptionError(node.where, f"{role} '{name}' is no link", f"allowed: {', '.join(links)}")
    axis, lower, upper = (0.0, 0.0, 1.0), float("-inf"), float("inf")
    axis_node = node.find("axis")
    if kind is not specs.JointType.FIXED:
        axis_node = node.require("axis")
    if axis_node is not None:
        x, y, z = axis_node.require("xyz").numbers(3)
        axis = (x, y, z)
        lower_node, upper_node = axis_node.find_path("limit", "lower"), axis_node.find_path("limit", "upper")
        lower = lower_node.number() if lower_node is not None else lower
        upper = upper_node.number() if upper_node is not None else upper
    pose_in_model = frames.joint_pose_in_model(node)
    pose = frames.pose_in_model(child).inverse() @ pose_in_model
    return specs.Joint(node.name(), kind, parent, child, pose, axis, lower, upper)


def _check_tree(node: XmlNode, model: specs.Model) -> None:
    """Refuses models whose links are not one tree: the physics engine knows trees only."""
    if model.static:
        return
    joints = [joint for joint in model.joints if joint.parent != "world"]
    children = [joint.child for joint in joints]
    roots = [link.name for link in model.links if link.name not in children]
    if len(roots) != 1 or len(set(children)) != len(children):
        raise DescriptionError(
            node.where,
            f"its joints leave {len(roots)} links without a parent ({', '.join(roots) or 'a closed loop'})",
            "a model that is not static needs joints that connect all its links to one tree",
        )
    parents = {joint.child: joint.parent for joint in joints}
    for link in model.links:
        seen = {link.name}
        name = link.name
        while name in parents:
            name = parents[name]
            if name in seen:
                raise DescriptionError(node.where, f"its joints form a loop through '{name}'", "allowed: trees")
            seen.add(name)
