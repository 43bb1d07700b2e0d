# SPDX-License-Identifier: BSD-3-Clause
"""Settings of an episode, and their form as JSON values in databases and records.

The names of the fields are the keys of experiment files, databases and records.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, TypeVar, get_args, get_origin, get_type_hints

from modular_framework_benchmark.records.perturbation import ObjectPerturbation


class SettingsError(ValueError):
    """A setting of an episode has a wrong type or value; the message names the setting."""


@dataclass(frozen=True, slots=True)
class PlacedObject:
    """An object with its initial pose.

    Attributes:
        name: Name of the object in the world.
        model: Folder in the search path of models, or absolute path of an .sdf file.
        x: Position in the world frame, with y and z [m].
        roll: Angle in the world frame, with pitch and yaw [rad].
        scale: Factor of the model's lengths; None for the size of the model file.
        perturbed: Perturbation of the object; None for none.
    """

    name: str
    model: str
    x: float
    y: float
    z: float
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    scale: float | None = None
    perturbed: ObjectPerturbation | None = None

    @property
    def xyz(self) -> tuple[float, float, float]:
        """Returns the position [m]."""
        return self.x, self.y, self.z

    @property
    def rpy(self) -> tuple[float, float, float]:
        """Returns roll, pitch and yaw [rad]."""
        return self.roll, self.pitch, self.yaw


@dataclass(frozen=True, slots=True)
class OwnMetric:
    """A metric of the user.

    Attributes:
        name: Name of the metric.
        function: FILE.py:NAME of the function that measures it, with an absolute path.
        is_rate: Whether the value must be 0 or 1.
        lowest: Smallest allowed value; None for no bound.
        highest: Largest allowed value; None for no bound.
    """

    name: str
    function: str
    is_rate: bool = False
    lowest: float | None = None
    highest: float | None = None


MetricSpec = str | OwnMetric
"""Name of a metric of the framework, or a metric of the user."""


@dataclass(frozen=True, slots=True)
class RecordedFiles:
    """Whether an episode keeps each kind of file."""

    log: bool = True
    trajectories: bool = True
    bag: bool = False
    video: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeSettings:
    """Settings that all modes have; the class of each mode adds its own.

    Attributes:
        metrics: Metrics to measure.
        record: Files that the episode keeps.
        time_limit: Maximum real duration [s].
    """

    metrics: tuple[MetricSpec, ...] = ()
    record: RecordedFiles = RecordedFiles()
    time_limit: float = 300.0

    @property
    def metric_names(self) -> tuple[str, ...]:
        """Returns the names of the metrics."""
        return tuple(metric if isinstance(metric, str) else metric.name for metric in self.metrics)

    @property
    def budget_s(self) -> float | None:
        """Returns the time budget of the planner or solver [s]; None without one."""
        return None

    @property
    def drawn_problem(self) -> str:
        """Returns the planning problem of the episode as text; "" in modes without problems."""
        return ""

    @property
    def has_milestones(self) -> bool:
        """Returns whether the episode has milestones, which give it a progress."""
        return False

    @property
    def is_shaken(self) -> bool:
        """Returns whether the arm shakes the object at the end of the episode, which gives the episode a hold time."""
        return False

    @property
    def files(self) -> tuple[Path, ...]:
        """Returns the named files whose content determines the episode, without scene and problem."""
        return ()

    @property
    def packages(self) -> frozenset[str]:
        """Returns the packages that the settings name."""
        return frozenset()


class Tagged:
    """Base of dataclasses that can stand in the same field; JSON values name the class: `{"upright": {...}}`."""

    __slots__ = ()
    kinds: ClassVar[dict[str, type[Tagged]]] = {}
    """All classes, keyed by their name with underscores."""

    def __init_subclass__(cls) -> None:
        """Registers the class."""
        Tagged.kinds[_snake_case_name(cls.__name__)] = cls

    @property
    def kind(self) -> str:
        """Returns the name of the class with underscores."""
        return _snake_case_name(type(self).__name__)


def _snake_case_name(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


SettingsT = TypeVar("SettingsT", bound=EpisodeSettings)
_T = TypeVar("_T")


def as_json(value: Any) -> Any:
    """Returns a value as JSON values; a dataclass becomes a mapping of its fields that are not None."""
    if is_dataclass(value):
        content = {item.name: getattr(value, item.name) for item in fields(value)}
        mapping = {name: as_json(part) for name, part in content.items() if part is not None}
        return {value.kind: mapping} if isinstance(value, Tagged) else mapping
    return [as_json(part) for part in value] if isinstance(value, tuple) else value


def from_json(kind: Callable[..., _T], content: Mapping[str, Any]) -> _T:
    """Returns a dataclass from JSON values of `as_json` or `dataclasses.asdict`; ignores unknown keys.

    Args:
        kind: Class of the result.
        content: JSON values by field name.

    Raises:
        TypeError: A required field is missing.
        ValueError: A text is not a value of its enumeration.
    """
    hints = _hints(kind)
    return kind(**{name: _decode_value(hints[name], value) for name, value in content.items() if name in hints})


_hints = lru_cache(get_type_hints)


def _decode_value(hint: Any, value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_decode_value(get_args(hint)[0], part) for part in value)
    hints = [item for item in (hint, *get_args(hint)) if isinstance(item, type)]
    choices = next((item for item in hints if issubclass(item, Enum)), None)
    if choices is not None:
        return None if value is None else choices(value)
    if get_origin(hint) is Mapping and is_dataclass(get_args(hint)[1]):
        return {name: _decode_value(get_args(hint)[1], part) for name, part in value.items()}
    if isinstance(value, Mapping) and any(issubclass(item, Tagged) for item in hints):
        ((name, content),) = value.items()
        return from_json(Tagged.kinds[name], content)
    kind = next((item for item in hints if is_dataclass(item)), None)
    return from_json(kind, value) if isinstance(value, Mapping) and kind is not None else value
