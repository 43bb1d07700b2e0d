# SPDX-License-Identifier: BSD-3-Clause
"""Works out what has to change in a planning scene so that it shows the simulated world.

Sent are new, moved and vanished objects, and objects that the gripper took or let go. Small movements are left out:
physics never stands entirely still.

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
class Put:
    """An object is new in the world, or replaces the one of the same name."""

    key: ObjectKey
    link: specs.Link
    pose_in_world: Pose


@dataclass(frozen=True, slots=True)
class Move:
    """An object is elsewhere in the world."""

    key: ObjectKey
    pose_in_world: Pose


@dataclass(frozen=True, slots=True)
class Remove:
    """An object is gone from the world."""

    key: ObjectKey


@dataclass(frozen=True, slots=True)
class Attach:
    """An object is carried by a link of the robot; it is no longer an object of the world."""

    key: ObjectKey
    link: specs.Link
    carrier_link: str
    pose_in_carrier: Pose


@dataclass(frozen=True, slots=True)
class Detach:
    """An object is no longer carried."""

    key: ObjectKey
    carrier_link: str


Change = Put | Move | Remove | Attach | Detach


@dataclass(frozen=True, slots=True)
class _Shown:
    """How an object was last sent: its pose is in the world, or in the carrier link if it is carried."""

    instance: int
    pose: Pose
    carrier_link: str | None


@dataclass(frozen=True, slots=True)
class _Wanted:
    shown: _Shown
    link: specs.Link


class SceneChanges:
    """Remembers what was sent, and where the scene really has it.

    Args:
        translation_m: Smaller movements are not reported [m].
        rotation_rad: Smaller turns are not reported [rad].
    """

    def __init__(self, translation_m: float = 0.001, rotation_rad: float = 0.01) -> None:
        self._translation_m = translation_m
        self._rotation_rad = rotation_rad
        self._shown: dict[ObjectKey, _Shown] = {}
        self._pending: dict[ObjectKey, _Shown] = {}
        self._in_world: frozenset[ObjectKey] = frozenset()
        self._attached: dict[ObjectKey, str] = {}
        self._witnesses: frozenset[ObjectKey] = frozenset()

    @property
    def keys(self) -> Set[ObjectKey]:
        """Objects that were sent; `compare` needs to know where these are."""
        return self._shown.keys()

    def compare(self, in_world: Set[ObjectKey], attached: Mapping[ObjectKey, str]) -> list[ObjectKey]:
        """Takes in where the scene has the objects.

        Args:
            in_world: Objects of the world.
            attached: The others that the scene has, with the links they are attached to.

        Returns:
            Objects that another node took out, and that stay out for now: each is named once.
        """
        foreign = {key for key, link in self._attached.items() if link != self._shown[key].carrier_link}
        for key in foreign & in_world:  # another node attached it, and put it down elsewhere
            del self._shown[key]
        expected = {key for key, shown in self._shown.items() if shown.carrier_link is None and key not in attached}
        witnesses = expected & self._witnesses or expected
        if not witnesses & in_world and (witnesses or not attached):  # cleared, or another receiver
            for key in self._shown.keys() - in_world - attached.keys():
                del self._shown[key]
        gone = (self._in_world | self._attached.keys()) & self._shown.keys() - in_world - attached.keys()
        self._in_world = self._witnesses = frozenset(in_world & self._shown.keys())
        self._attached = {key: link for key, link in attached.items() if key in self._shown}
        return sorted(gone)

    def towards(self, snapshot: WorldSnapshot) -> list[Change]:
        """Returns what has to be sent; `confirm` must follow once it was taken.

        Args:
            snapshot: The world as it is now.
        """
        wanted = _wanted(snapshot)
        self._pending = dict(self._shown)
        changes: list[Change] = []
        for key, shown in self._shown.items():
            if key not in wanted or wanted[key].shown.instance != shown.instance:
                changes += [Detach(key, self._attached[key])] if key in self._attached else []
                changes.append(Remove(key))
                del self._pending[key]
        for key, want in wanted.items():
            changes += self._change_of(key, want)
        return changes

    def confirm(self) -> None:
        """Notes that the scene has the changes of the last `towards`."""
        changed = {key for key, shown in self._pending.items() if self._shown.get(key) is not shown}
        kept = self._pending.keys() - changed
        taken = {key: shown.carrier_link for key in changed if (shown := self._pending[key]).carrier_link is not None}
        self._in_world = frozenset((self._in_world & kept) | (changed - taken.keys()))
        self._attached = {key: link for key, link in self._attached.items() if key in kept} | taken
        self._shown = self._pending

    def _change_of(self, key: ObjectKey, want: _Wanted) -> list[Change]:
        before, now = self._pending.get(key), want.shown
        if before is not None and before.carrier_link == now.carrier_link and not self._moved(before.pose, now.pose):
            return []
        carrier = self._attached.get(key) if before is not None else None
        if now.carrier_link is None and carrier is not None and before is not None and before.carrier_link is None:
            return []  # another node attached it, as a pick does: the gripper will take it, or that node puts it down
        self._pending[key] = now
        if now.carrier_link is not None:
            return [Attach(key, want.link, now.carrier_link, now.pose)]
        if carrier is not None:
            return [Detach(key, carrier), Put(key, want.link, now.pose)]
        if before is None or before.carrier_link is not None or key not in self._in_world:
            return [Put(key, want.link, now.pose)]
        return [Move(key, now.pose)]

    def _moved(self, before: Pose, now: Pose) -> bool:
        translation, rotation = before.distance_to(now)
        return translation > self._translation_m or rotation > self._rotation_rad


def _wanted(snapshot: WorldSnapshot) -> dict[ObjectKey, _Wanted]:
    wanted: dict[ObjectKey, _Wanted] = {}
    held = snapshot.held
    for model in snapshot.models:
        for link in model.links:
            key = (model.name, link.spec.name)
            if held is not None and held.model == model.name:
                pose_in_carrier = held.carrier_in_world.inverse() @ link.pose_in_world
                wanted[key] = _Wanted(_Shown(model.instance, pose_in_carrier, held.carrier_link), link.spec)
            else:
                wanted[key] = _Wanted(_Shown(model.instance, link.pose_in_world, None), link.spec)
    return wanted
