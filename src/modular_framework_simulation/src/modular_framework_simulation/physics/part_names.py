# SPDX-License-Identifier: BSD-3-Clause
"""Names of links and joints in requests: scoped by their model, or alone where only one model has such a part."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from modular_framework_simulation.errors import AmbiguousNameError, UnknownEntityError
from modular_framework_simulation.physics.simulated_body import SimulatedBody

SCOPE = "::"
"""Separates a model from its link or joint in the name of the latter, as in model::link."""


@dataclass(frozen=True, slots=True)
class PartName:
    """A link or a joint of a model.

    Attributes:
        model: Instance name of the model.
        part: Name of the link or joint in the model.
    """

    model: str
    part: str

    @property
    def scoped(self) -> str:
        """The full name: model::part."""
        return f"{self.model}{SCOPE}{self.part}"


def find_link(bodies: Mapping[str, SimulatedBody], name: str) -> PartName:
    """Returns the link of a name: "model::link", or "link" where one model has such a link.

    Raises:
        UnknownEntityError: No model has it.
        AmbiguousNameError: Several have it.
    """
    return _find(bodies, "link", name, SimulatedBody.link_names)


def find_joint(bodies: Mapping[str, SimulatedBody], name: str) -> PartName:
    """Returns the joint of a name: "model::joint", or "joint" where one model has such a joint.

    Raises:
        UnknownEntityError: No model has it.
        AmbiguousNameError: Several have it.
    """
    return _find(bodies, "joint", name, SimulatedBody.joint_names)


def _find(
    bodies: Mapping[str, SimulatedBody], kind: str, name: str, parts: Callable[[SimulatedBody], list[str]]
) -> PartName:
    model, separator, _ = name.rpartition(SCOPE)
    scoping = [each for each in bodies if name.startswith(each + SCOPE)]  # names of models may hold the separator too
    if separator and not scoping:
        raise UnknownEntityError("model", model, list(bodies))
    known = [PartName(each, own) for each in scoping or bodies for own in parts(bodies[each])]
    found = [item for item in known if name in (item.scoped, item.part)]
    if not found:
        raise UnknownEntityError(kind, name, [item.scoped for item in known])
    if len(found) > 1:
        raise AmbiguousNameError(kind, name, [item.scoped for item in found])
    return found[0]


def find_frame(bodies: Mapping[str, SimulatedBody], name: str, world_frames: Collection[str]) -> str:
    """Returns the full name of what a request gives poses relative to: the world, a model, or a link.

    Args:
        bodies: The models by name.
        name: "model", "model::link", or "link" where one model has such a link.
        world_frames: Names of the world.

    Raises:
        UnknownEntityError: There is no such model or link.
        AmbiguousNameError: Several models have such a link.
    """
    if name in world_frames or name in bodies:
        return name
    if SCOPE not in name and not any(name in body.link_names() for body in bodies.values()):
        raise UnknownEntityError("model", name, list(bodies))
    return find_link(bodies, name).scoped
