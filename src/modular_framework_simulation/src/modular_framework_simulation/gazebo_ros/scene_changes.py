# SPDX-License-Identifier: BSD-3-Clause
"""Computes the changes that make a planning scene equal to the simulated world.

Sent are new, moved and vanished objects, and objects that the gripper took or let go. Small movements are left out:
a simulated body is never completely at rest.

Other nodes change the scene too. An object that one of them removed, attached or detached by its name stays like that
until it moves, is spawned again, or the gripper takes it or lets it go. A scene in which none of the objects is left
was cleared, or belongs to a receiver that was started again: it gets all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass

from modular_framework_simulation.loop.snapshots import WorldSnapshot
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose

ObjectKey = tuple[str, str]
"""Model and link name."""


@dataclass(frozen=True, slots=True)
class ObjectChange:
    """A change of one object."""

    key: ObjectKey


@dataclass(frozen=True, slots=True)
class Add(ObjectChange):
    """An object is new in the world, or replaces the one of the same name."""

    link: specs.Link
    pose_in_world: Pose


@dataclass(frozen=True, slots=True)
class Move(ObjectChange):
    """An object is elsewhere in the world."""

    pose_in_world: Pose


@dataclass(frozen=True, slots=True)
class Remove(ObjectChange):
    """An object is gone from the world."""


@dataclass(frozen=True, slots=True)
class Attach(ObjectChange):
    """An object is carried by a link of the robot; it is no longer an object of the world."""

    link: specs.Link
    carrier_link: str
    pose_in_carrier: Pose
    touch_links: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Detach(ObjectChange):
    """An object is no longer carried."""

    carrier_link: str


Change = Add | Move | Remove | Attach | Detach


@dataclass(frozen=True, slots=True)
class _ObjectState:
    """An object of the scene: its pose is in the world, or in the carrier link if it is carried."""

    instance: int
    pose: Pose
    carrier_link: str | None


@dataclass(frozen=True, slots=True)
class _Target:
    state: _ObjectState
    link: specs.Link
    touch_links: tuple[str, ...] = ()


class SceneChanges:
    """Stores what was sent, and what the scene actually has.

    Args:
        translation_m: Smaller movements are not reported [m].
        rotation_rad: Smaller turns are not reported [rad].
    """

    def __init__(self, translation_m: float = 0.001, rotation_rad: float = 0.01) -> None:
        self._translation_m = translation_m
        self._rotation_rad = rotation_rad
        self._exact = False
        self._sent: dict[ObjectKey, _ObjectState] = {}
        self._pending: dict[ObjectKey, _ObjectState] = {}
        self._in_world: frozenset[ObjectKey] = frozenset()
        self._attached: dict[ObjectKey, str] = {}
        # A scene without any of these was cleared, or belongs to a receiver that was started again.
        self._witnesses: frozenset[ObjectKey] = frozenset()

    @property
    def keys(self) -> Set[ObjectKey]:
        """Objects that were sent; `compare` needs to know where these are."""
        return self._sent.keys()

    def compare(self, in_world: Set[ObjectKey], attached: Mapping[ObjectKey, str]) -> list[ObjectKey]:
        """Stores where the scene has the objects.

        Args:
            in_world: Objects of the world.
            attached: The others that the scene has, with the links they are attached to.

        Returns:
            Objects that another node took out, and that stay out for now: each is named once.
        """
        foreign = {key for key, link in self._attached.items() if link != self._sent[key].carrier_link}
        for key in foreign & in_world:  # another node attached it, and put it down elsewhere
            del self._sent[key]
        expected = {key for key, sent in self._sent.items() if sent.carrier_link is None and key not in attached}
        witnesses = expected & self._witnesses or expected
        if not witnesses & in_world and (witnesses or not attached):  # cleared, or another receiver
            for key in self._sent.keys() - in_world - attached.keys():
                del self._sent[key]
        gone = (self._in_world | self._attached.keys()) & self._sent.keys() - in_world - attached.keys()
        self._in_world = self._witnesses = frozenset(in_world & self._sent.keys())
        self._attached = {key: link for key, link in attached.items() if key in self._sent}
        return sorted(gone)

    def towards(self, snapshot: WorldSnapshot, exact: bool = False) -> list[Change]:
        """Returns the changes to send; call `confirm` once the scene accepted them.

        Args:
            snapshot: The present world.
            exact: Whether small movements count, so that the scene does not depend on what was sent before.
        """
        self._exact = exact
        targets = _targets_of(snapshot)
        self._pending = dict(self._sent)
        changes: list[Change] = []
        for key, sent in self._sent.items():
            if key not in targets or targets[key].state.instance != sent.instance:
                changes += [Detach(key, self._attached[key])] if key in self._attached else []
                changes.append(Remove(key))
                del self._pending[key]
        for key, target in targets.items():
            changes += self._change_of(key, target)
        return changes

    def confirm(self) -> None:
        """Marks the changes of the last `towards` as in force."""
        changed = {key for key, sent in self._pending.items() if self._sent.get(key) is not sent}
        kept = self._pending.keys() - changed
        taken = {key: sent.carrier_link for key in changed if (sent := self._pending[key]).carrier_link is not None}
        self._in_world = frozenset((self._in_world & kept) | (changed - taken.keys()))
        self._attached = {key: link for key, link in self._attached.items() if key in kept} | taken
        self._sent = self._pending

    def _change_of(self, key: ObjectKey, target: _Target) -> list[Change]:
        before, now = self._pending.get(key), target.state
        if before is not None and before.carrier_link == now.carrier_link and not self._moved(before.pose, now.pose):
            return []
        carrier = self._attached.get(key) if before is not None else None
        if now.carrier_link is None and carrier is not None and before is not None and before.carrier_link is None:
            return []  # another node attached it, as a pick does: the gripper will take it, or that node puts it down
        self._pending[key] = now
        if now.carrier_link is not None:
            return [Attach(key, target.link, now.carrier_link, now.pose, target.touch_links)]
        if carrier is not None:
            return [Detach(key, carrier), Add(key, target.link, now.pose)]
        if before is None or before.carrier_link is not None or key not in self._in_world:
            return [Add(key, target.link, now.pose)]
        return [Move(key, now.pose)]

    def _moved(self, before: Pose, now: Pose) -> bool:
        if self._exact:
            return before != now
        translation, rotation = before.distance_to(now)
        return translation > self._translation_m or rotation > self._rotation_rad


def _targets_of(snapshot: WorldSnapshot) -> dict[ObjectKey, _Target]:
    targets: dict[ObjectKey, _Target] = {}
    carried = {held.model: held for held in snapshot.held}
    for model in snapshot.models:
        for link in model.links:
            key = (model.name, link.spec.name)
            if (held := carried.get(model.name)) is not None:
                pose_in_carrier = held.carrier_in_world.inverse() @ link.pose_in_world
                state = _ObjectState(model.instance, pose_in_carrier, held.carrier_link)
                targets[key] = _Target(state, link.spec, held.touch_links)
            else:
                targets[key] = _Target(_ObjectState(model.instance, link.pose_in_world, None), link.spec)
    return targets
