# SPDX-License-Identifier: BSD-3-Clause
"""Pickling of requests for a process with the same robot, without the robot model and collision geometry."""

from __future__ import annotations

import io
import pickle
from dataclasses import fields
from typing import Any

from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.errors import PlanningError
from modular_framework_planning.geometry.shapes import Shape
from modular_framework_planning.robot_model.robot_model import RobotModel

ROBOT_ID = "robot model"


def _make_shape(kind: type[Shape], values: dict[str, Any]) -> Shape:
    return kind(**values)


class _Pickler(pickle.Pickler):
    """Omits data that the receiving process already has or builds."""

    def persistent_id(self, item: Any) -> str | None:
        """Replaces the robot model by an id."""
        return ROBOT_ID if isinstance(item, RobotModel) else None

    def reducer_override(self, item: Any) -> Any:
        """Writes shapes without collision geometry, constraints without buffers, and errors as their base class."""
        if isinstance(item, Shape):
            return _make_shape, (type(item), {field.name: getattr(item, field.name) for field in fields(item)})  # type: ignore[arg-type]
        if isinstance(item, KinematicConstraints):
            return KinematicConstraints, (item.model, item.joints, item.positions, item.orientations, item.name)
        if isinstance(item, PlanningError):
            return PlanningError, (item.code, item.reason, item.contacts, item.statistics)
        return NotImplemented


class _Unpickler(pickle.Unpickler):
    """Inserts the robot model of this process."""

    def __init__(self, stream: io.BytesIO, model: RobotModel) -> None:
        super().__init__(stream)
        self._model = model

    def persistent_load(self, name: str) -> RobotModel:
        """Returns the robot model."""
        if name != ROBOT_ID:
            raise pickle.UnpicklingError(f"unknown persistent id '{name}'; allowed: '{ROBOT_ID}'")
        return self._model


def to_bytes(item: object) -> bytes:
    """Serialises a request, scene or result."""
    stream = io.BytesIO()
    _Pickler(stream, protocol=pickle.HIGHEST_PROTOCOL).dump(item)
    return stream.getvalue()


def from_bytes(data: bytes, model: RobotModel) -> Any:
    """Deserialises the output of `to_bytes` from a process with the same robot."""
    return _Unpickler(io.BytesIO(data), model).load()
