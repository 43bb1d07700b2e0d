# SPDX-License-Identifier: BSD-3-Clause
"""Computes the changes that make a planning scene equal to the simulated world.

The changes cover new, moved and removed objects, and objects grasped or released by the gripper. Small movements are
ignored, because a simulated body is never completely at rest.

Other nodes also change the scene. An object that another node removed, attached or detached by name keeps this state
until the object moves, is spawned again, or is grasped or released. A scene without any of the objects was cleared, or
belongs to a restarted receiver; then all objects are sent.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass

from modular_framework_simulation.loop.snapshots import WorldSnapshot
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose

ObjectKey = tuple[str, str]
"""Names of model and link."""


@dataclass(frozen=True, slots=True)
class ObjectChange:
    """Change of one object."""

    key: ObjectKey


@dataclass(frozen=True, slots=True)
class Add(ObjectChange):
    """Adds a new object to the world, or replaces the object with the same name."""

    link: specs.Link
    pose_in_world: Pose


@dataclass(frozen=True, slots=True)
class Move(ObjectChange):
    """Moves an object in the world."""

    pose_in_world: Pose


@dataclass(frozen=True, slots=True)
class Remove(ObjectChange):
    """Removes an object from the world."""


@dataclass(frozen=True, slots=True)
class Attach(ObjectChange):
    """Attaches an object to a robot link, which removes the object from the world."""

    link: specs.Link
    carrier_link: str
    pose_in_carrier: Pose
    touch_links: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Detach(ObjectChange):
    """Detaches an object from a robot link."""

    carrier_link: str


Change = Add | Move | Remove | Attach | Detach


@dataclass(frozen=True, slots=True)
class _ObjectState:
    """State of an object in the scene, with its pose in the world frame or in the frame of its carrier link."""

    instance: int
    pose: Pose
    carrier_link: str | None


@dataclass(frozen=True, slots=True)
class _Target:
    state: _ObjectState
    link: specs.Link
    touch_links: tuple[str, ...] = ()


class SceneChanges:
    """Stores the sent objects and the actual contents of the scene.

    Args:
        translation_m: Minimum translation of a reported movement [m].
        rotation_rad: Minimum rotation of a reported movement [rad].
    """

    def __init__(self, translation_m: float = 0.001, rotation_rad: float = 0.01) -> None:
        self._translation_m = translation_m
        self._rotation_rad = rotation_rad
        self._exact = False
        self._sent: dict[ObjectKey, _ObjectState] = {}
        self._pending: dict[ObjectKey, _ObjectState] = {}
        self._in_world: frozenset[ObjectKey] = frozenset()
        self._attached: dict[ObjectKey, str] = {}
        # A scene without any of these objects was cleared, or belongs to a restarted receiver.
        self._witnesses: frozenset[ObjectKey] = frozenset()

    @property
    def keys(self) -> Set[ObjectKey]:
        """Returns the keys of the sent objects, which `compare` needs."""
        return self._sent.keys()

    def compare(self, in_world: Set[ObjectKey], attached: Mapping[ObjectKey, str]) -> list[ObjectKey]:
        """Stores the actual contents of the scene.

        Args:
            in_world: Objects in the world of the scene.
            attached: Robot link of each attached object in the scene.

        Returns:
            Objects that another node has removed; each removal is returned once.
        """
        foreign = {key for key, link in self._attached.items() if link != self._sent[key].carrier_link}
        for key in foreign & in_world:  # another node attached the object and placed it elsewhere
            del self._sent[key]
        expected = {key for key, state in self._sent.items() if state.carrier_link is None and key not in attached}
        witnesses = expected & self._witnesses or expected
        if not witnesses & in_world and (witnesses or not attached):  # cleared scene, or restarted receiver
            for key in self._sent.keys() - in_world - attached.keys():
                del self._sent[key]
        removed = (self._in_world | self._attached.keys()) & self._sent.keys() - in_world - attached.keys()
        self._in_world = self._witnesses = frozenset(in_world & self._sent.keys())
        self._attached = {key: link for key, link in attached.items() if key in self._sent}
        return sorted(removed)

    def changes_towards(self, snapshot: WorldSnapshot, exact: bool = False) -> list[Change]:
        """Returns the changes to send; after the scene has accepted them, call `confirm`.

        Args:
            snapshot: Current state of the world.
            exact: Whether to report small movements, so that the scene is independent of previous changes.
        """
        self._exact = exact
        targets = _targets_of(snapshot)
        self._pending = dict(self._sent)
        changes: list[Change] = []
        for key, state in self._sent.items():
            if key not in targets or targets[key].state.instance != state.instance:
                changes += [Detach(key, self._attached[key])] if key in self._attached else []
                changes.append(Remove(key))
                del self._pending[key]
        for key, target in targets.items():
            changes += self._change_of(key, target)
        return changes

    def confirm(self) -> None:
        """Records that the scene has accepted the changes of the last `changes_towards`."""
        changed = {key for key, state in self._pending.items() if self._sent.get(key) is not state}
        unchanged = self._pending.keys() - changed
        attached = {
            key: state.carrier_link for key in changed if (state := self._pending[key]).carrier_link is not None
        }
        self._in_world = frozenset((self._in_world & unchanged) | (changed - attached.keys()))
        self._attached = {key: link for key, link in self._attached.items() if key in unchanged} | attached
        self._sent = self._pending

    def _change_of(self, key: ObjectKey, target: _Target) -> list[Change]:
        previous, now = self._pending.get(key), target.state
        if (
            previous is not None
            and previous.carrier_link == now.carrier_link
            and not self._has_moved(previous.pose, now.pose)
        ):
            return []
        carrier = self._attached.get(key) if previous is not None else None
        if now.carrier_link is None and carrier is not None and previous is not None and previous.carrier_link is None:
            return []  # another node attached the object, as in a pick; the gripper grasps it or that node detaches it
        self._pending[key] = now
        if now.carrier_link is not None:
            return [Attach(key, target.link, now.carrier_link, now.pose, target.touch_links)]
        if carrier is not None:
            return [Detach(key, carrier), Add(key, target.link, now.pose)]
        if previous is None or previous.carrier_link is not None or key not in self._in_world:
            return [Add(key, target.link, now.pose)]
        return [Move(key, now.pose)]

    def _has_moved(self, previous: Pose, now: Pose) -> bool:
        if self._exact:
            return previous != now
        translation, rotation = previous.distance_to(now)
        return translation > self._translation_m or rotation > self._rotation_rad


def _targets_of(snapshot: WorldSnapshot) -> dict[ObjectKey, _Target]:
    targets: dict[ObjectKey, _Target] = {}
    held_by_model = {held.model: held for held in snapshot.held}
    for model in snapshot.models:
        for link in model.links:
            key = (model.name, link.spec.name)
            if (held := held_by_model.get(model.name)) is not None:
                pose_in_carrier = held.carrier_in_world.inverse() @ link.pose_in_world
                state = _ObjectState(model.instance, pose_in_carrier, held.carrier_link)
                targets[key] = _Target(state, link.spec, held.touch_links)
            else:
                targets[key] = _Target(_ObjectState(model.instance, link.pose_in_world, None), link.spec)
    return targets
