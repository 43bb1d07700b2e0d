# SPDX-License-Identifier: BSD-3-Clause
"""Works out what has to change in a planning scene so that it shows the simulated world.

The receiver is told of new, moved and vanished objects, and of objects that the gripper took or let go. Small movements
are left out: physics never stands entirely still.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from modular_framework_simulation import sdf_specs as specs
from modular_framework_simulation.poses import Pose
from modular_framework_simulation.snapshots import WorldSnapshot

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
    """How an object was last shown: its pose is in the world, or in the carrier link if it is carried."""

    instance: int
    pose: Pose
    carrier_link: str | None


@dataclass(frozen=True, slots=True)
class _Wanted:
    shown: _Shown
    link: specs.Link


class SceneChanges:
    """Remembers what the receiver was told.

    Args:
        translation_m: Smaller movements are not reported [m].
        rotation_rad: Smaller turns are not reported [rad].
    """

    def __init__(self, translation_m: float = 0.001, rotation_rad: float = 0.01) -> None:
        self._translation_m = translation_m
        self._rotation_rad = rotation_rad
        self._shown: dict[ObjectKey, _Shown] = {}
        self._pending: dict[ObjectKey, _Shown] = {}
        self._doubtful: set[ObjectKey] = set()

    def forget(self) -> None:
        """Takes it that what the receiver knows is uncertain: it was started again, or refused a change.

        It will be told everything; objects that it may still have, but the world no longer has, are removed.
        """
        self._doubtful |= self._shown.keys() | self._pending.keys()
        self._shown = {}

    def towards(self, snapshot: WorldSnapshot) -> list[Change]:
        """Returns what the receiver has to be told; `confirm` must follow once it was.

        Args:
            snapshot: The world as it is now.
        """
        wanted = _wanted(snapshot)
        self._pending = dict(self._shown)
        changes: list[Change] = [Remove(key) for key in sorted(self._doubtful - wanted.keys())]
        for key, shown in self._shown.items():
            if key not in wanted or wanted[key].shown.instance != shown.instance:
                changes += [Detach(key, shown.carrier_link)] if shown.carrier_link is not None else []
                changes.append(Remove(key))
                del self._pending[key]
        for key, want in wanted.items():
            changes += self._change_of(key, want)
        return changes

    def confirm(self) -> None:
        """Notes that the receiver took the changes of the last `towards`."""
        self._shown = self._pending
        self._doubtful = set()

    def _change_of(self, key: ObjectKey, want: _Wanted) -> list[Change]:
        before, now = self._pending.get(key), want.shown
        if before is not None and before.carrier_link == now.carrier_link and not self._moved(before.pose, now.pose):
            return []
        self._pending[key] = replace(now)
        if now.carrier_link is not None:
            return [Attach(key, want.link, now.carrier_link, now.pose)]
        if before is None:
            return [Put(key, want.link, now.pose)]
        if before.carrier_link is not None:
            return [Detach(key, before.carrier_link), Put(key, want.link, now.pose)]
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
                pose = held.carrier_pose.inverse() @ link.pose
                wanted[key] = _Wanted(_Shown(model.instance, pose, held.carrier_link), link.spec)
            else:
                wanted[key] = _Wanted(_Shown(model.instance, link.pose, None), link.spec)
    return wanted
