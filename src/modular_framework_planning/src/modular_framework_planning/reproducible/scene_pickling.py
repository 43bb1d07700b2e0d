# SPDX-License-Identifier: BSD-3-Clause
"""Serialises requests for a process with the same robot: without the robot model and without built geometry."""

from __future__ import annotations

import io
import pickle
from dataclasses import fields
from typing import Any

from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.errors import PlanningError
from modular_framework_planning.geometry.shapes import Shape
from modular_framework_planning.robot_model.robot_model import RobotModel

ROBOT = "robot model"


def _shape(kind: type[Shape], values: dict[str, Any]) -> Shape:
    return kind(**values)


class _Pickler(pickle.Pickler):
    """Leaves out what the other process already has or builds itself."""

    def persistent_id(self, item: Any) -> str | None:
        """Names the robot model instead of writing it."""
        return ROBOT if isinstance(item, RobotModel) else None

    def reducer_override(self, item: Any) -> Any:
        """Writes shapes without built geometry, constraints without working memory and errors as their base class."""
        if isinstance(item, Shape):
            return _shape, (type(item), {field.name: getattr(item, field.name) for field in fields(item)})  # type: ignore[arg-type]
        if isinstance(item, KinematicConstraints):
            return KinematicConstraints, (item.model, item.joints, item.positions, item.orientations, item.name)
        if isinstance(item, PlanningError):
            return PlanningError, (item.code, item.reason, item.contacts, item.statistics)
        return NotImplemented


class _Unpickler(pickle.Unpickler):
    """Puts the robot model of this process in."""

    def __init__(self, stream: io.BytesIO, model: RobotModel) -> None:
        super().__init__(stream)
        self._model = model

    def persistent_load(self, name: str) -> RobotModel:
        """Returns the robot model."""
        if name != ROBOT:
            raise pickle.UnpicklingError(f"'{name}' is not known; only '{ROBOT}' is left out of the bytes")
        return self._model


def to_bytes(item: object) -> bytes:
    """Writes requests, scenes and answers."""
    stream = io.BytesIO()
    _Pickler(stream, protocol=pickle.HIGHEST_PROTOCOL).dump(item)
    return stream.getvalue()


def from_bytes(data: bytes, model: RobotModel) -> Any:
    """Reads what `to_bytes` of a process with the same robot wrote."""
    return _Unpickler(io.BytesIO(data), model).load()
