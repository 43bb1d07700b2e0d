# SPDX-License-Identifier: BSD-3-Clause
"""Errors of perception: the planning scene shows models displaced from their true poses.

A wrong pose estimate, or a wrong calibration from robot base to camera, displaces an object that the camera sees. The
world does not change; only the snapshot for the planning scene changes.
"""

from __future__ import annotations

import dataclasses

from modular_framework_simulation.loop.snapshots import HeldObject, LinkSnapshot, ModelSnapshot, WorldSnapshot
from modular_framework_simulation.models.poses import Pose
from modular_framework_urdf.rotations import Vector3, rotate_vector

_NO_ERROR = (0.0, 0.0, 0.0)


class PerceptionErrors:
    """Displacements of perceived models; only used by the loop's thread.

    While a gripper holds a model, the displacement is constant in the frame of the carrying link, because a planner
    keeps the pose in the hand that it assumed at the grasp.
    """

    def __init__(self) -> None:
        self._errors: dict[str, Vector3] = {}
        self._errors_in_hand: dict[str, Vector3] = {}

    def set(self, model: str, displacement: Vector3) -> None:
        """Sets the displacement of a model, which may be spawned later.

        Args:
            model: Name of the model.
            displacement: Perceived minus true position in the world frame, x, y, z [m]; zeros remove the error.
        """
        self._errors.pop(model, None)
        self._errors_in_hand.pop(model, None)
        if displacement != _NO_ERROR:
            self._errors[model] = displacement

    def clear(self) -> None:
        """Removes all errors."""
        self._errors.clear()
        self._errors_in_hand.clear()

    def perceived_snapshot(self, snapshot: WorldSnapshot) -> WorldSnapshot:
        """Returns the snapshot with displaced models; the true snapshot stays unchanged."""
        if not self._errors:
            return snapshot
        held = {each.model: each for each in snapshot.held}
        models = tuple(
            self._displaced_model(model, held.get(model.name)) if model.name in self._errors else model
            for model in snapshot.models
        )
        return dataclasses.replace(snapshot, models=models)

    def _displaced_model(self, model: ModelSnapshot, held: HeldObject | None) -> ModelSnapshot:
        error = self._errors[model.name]
        if held is None:
            self._errors_in_hand.pop(model.name, None)
        else:
            to_world = held.carrier_in_world.quaternion
            if model.name not in self._errors_in_hand:
                to_carrier = held.carrier_in_world.inverse().quaternion
                self._errors_in_hand[model.name] = rotate_vector(to_carrier, error)
            error = rotate_vector(to_world, self._errors_in_hand[model.name])
        return dataclasses.replace(model, links=tuple(_displaced_link(link, error) for link in model.links))


def _displaced_link(link: LinkSnapshot, displacement: Vector3) -> LinkSnapshot:
    (x, y, z), (dx, dy, dz) = link.pose_in_world.position, displacement
    return LinkSnapshot(link.spec, Pose((x + dx, y + dy, z + dz), link.pose_in_world.quaternion))
