# SPDX-License-Identifier: BSD-3-Clause
"""Applies the <state> of a saved world: the model poses at the time of saving."""

from __future__ import annotations

import dataclasses

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_frames import pose_of
from modular_framework_simulation.models.xml_nodes import XmlNode

_TOLERANCE_M, _TOLERANCE_RAD = 1e-3, 1e-3
"""Tolerances of saved poses, which are rounded; a link within the tolerances has not moved."""


def with_saved_state(models: list[specs.Model], state: XmlNode | None) -> list[specs.Model]:
    """Returns the models at the poses of a <state>.

    Args:
        models: Models of the world.
        state: The <state> element; None if the world has none.

    Raises:
        DescriptionError: The state adds or removes models, or a pose is invalid.
    """
    if state is None:
        return models
    for tag in ("insertions", "deletions"):
        change = state.find(tag)
        if change is not None and change.children:
            raise DescriptionError(change.where, "adds or removes models", "allowed: a saved world without changes")
    saved = {node.attributes.get("name", ""): node for node in state.find_all("model")}
    return [_restored(model, saved[model.name]) if model.name in saved else model for model in models]


def _restored(model: specs.Model, saved: XmlNode) -> specs.Model:
    notes = list(model.notes)
    pose_node, scale = saved.find("pose"), saved.find("scale")
    if scale is not None and any(abs(value - 1) > 1e-6 for value in scale.numbers(3)):
        raise DescriptionError(scale.where, f"got '{scale.text.strip()}'", "allowed: 1 1 1; scale the model's file")
    pose = pose_of(pose_node) if pose_node is not None else model.pose
    link_poses = {node.attributes.get("name", ""): node.find("pose") for node in saved.find_all("link")}
    moved: dict[str, Pose] = {}
    for link in model.links:
        node = link_poses.get(link.name)
        if node is None:
            continue
        in_model = pose.inverse() @ pose_of(node)
        distance, angle = in_model.distance_to(link.pose)
        if distance > _TOLERANCE_M or angle > _TOLERANCE_RAD:
            moved[link.name] = in_model
    if moved and model.joints:
        notes.append(f"{saved.where}: the saved joint positions have no effect; the joints start at 0")
        moved = {}
    links = tuple(dataclasses.replace(link, pose=moved.get(link.name, link.pose)) for link in model.links)
    return dataclasses.replace(model, pose=pose, links=links, notes=tuple(notes))
