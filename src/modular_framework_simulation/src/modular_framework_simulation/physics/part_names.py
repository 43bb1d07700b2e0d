# SPDX-License-Identifier: BSD-3-Clause
"""Resolves names of links and joints in requests; the name of the model is optional for unique names."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from modular_framework_simulation.errors import AmbiguousNameError, UnknownEntityError
from modular_framework_simulation.physics.simulated_body import SimulatedBody

SCOPE = "::"
"""Separator between the names of a model and its link or joint, as in model::link."""


@dataclass(frozen=True, slots=True)
class PartName:
    """Name of a link or joint of a model.

    Attributes:
        model: Name of the model in the world.
        part: Name of the link or joint in the model.
    """

    model: str
    part: str

    @property
    def scoped_name(self) -> str:
        """Returns the full name, model::part."""
        return f"{self.model}{SCOPE}{self.part}"


def find_link(bodies: Mapping[str, SimulatedBody], name: str) -> PartName:
    """Returns the link with a name: "model::link", or "link" for a unique link name.

    Raises:
        UnknownEntityError: No model has the link.
        AmbiguousNameError: Several models have the link.
    """
    return _find(bodies, "link", name, SimulatedBody.link_names)


def find_joint(bodies: Mapping[str, SimulatedBody], name: str) -> PartName:
    """Returns the joint with a name: "model::joint", or "joint" for a unique joint name.

    Raises:
        UnknownEntityError: No model has the joint.
        AmbiguousNameError: Several models have the joint.
    """
    return _find(bodies, "joint", name, SimulatedBody.joint_names)


def _find(
    bodies: Mapping[str, SimulatedBody], kind: str, name: str, parts: Callable[[SimulatedBody], list[str]]
) -> PartName:
    model, separator, _ = name.rpartition(SCOPE)
    models_in_name = [each for each in bodies if name.startswith(each + SCOPE)]  # model names may contain the separator
    if separator and not models_in_name:
        raise UnknownEntityError("model", model, list(bodies))
    known = [PartName(each, own) for each in models_in_name or bodies for own in parts(bodies[each])]
    found = [item for item in known if name in (item.scoped_name, item.part)]
    if not found:
        raise UnknownEntityError(kind, name, [item.scoped_name for item in known])
    if len(found) > 1:
        raise AmbiguousNameError(kind, name, [item.scoped_name for item in found])
    return found[0]


def find_frame(bodies: Mapping[str, SimulatedBody], name: str, world_frames: Collection[str]) -> str:
    """Returns the full name of a reference frame in a request: the world, a model, or a link.

    Args:
        bodies: Models by name.
        name: "model", "model::link", or "link" for a unique link name.
        world_frames: Names of the world frame.

    Raises:
        UnknownEntityError: The model or link does not exist.
        AmbiguousNameError: Several models have the link.
    """
    if name in world_frames or name in bodies:
        return name
    if SCOPE not in name and not any(name in body.link_names() for body in bodies.values()):
        raise UnknownEntityError("model", name, list(bodies))
    return find_link(bodies, name).scoped_name
