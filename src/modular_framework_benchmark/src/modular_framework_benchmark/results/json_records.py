# SPDX-License-Identifier: BSD-3-Clause
"""Converts descriptions and records to JSON text and back."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, fields, is_dataclass
from enum import Enum
from pathlib import PurePath
from typing import Any

from modular_framework_benchmark.experiments.modes import stored_settings
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec
from modular_framework_benchmark.records.episode_settings import as_json, from_json
from modular_framework_benchmark.records.experiment import ExperimentDescription


def to_json(value: Any) -> str:
    """Returns a value as JSON with sorted keys, so that equal values give equal texts.

    Raises:
        TypeError: The value contains something other than JSON and NumPy values, enumerations, paths and data classes.
    """
    return json.dumps(value, sort_keys=True, default=_to_json_value, separators=(",", ":"))


def _to_json_value(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    if is_dataclass(value):
        return as_json(value)
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Mapping):
        return dict(value)
    if hasattr(value, "tolist"):  # arrays and scalars of NumPy
        return value.tolist()
    raise TypeError(
        f"{value!r} of type {type(value).__name__} cannot be stored; use numbers, texts, lists and mappings"
    )


def description_to_json(description: ExperimentDescription) -> str:
    """Returns a description as JSON."""
    return to_json(asdict(description))


def description_from_json(text: str) -> ExperimentDescription:
    """Returns the description from the text of `description_to_json`."""
    return from_json(ExperimentDescription, json.loads(text))


def record_to_json(record: EpisodeRecord) -> str:
    """Returns a record and its episode's specification as JSON."""
    content = {item.name: getattr(record, item.name) for item in fields(record)}
    return to_json(content | {"spans": [asdict(span) for span in record.spans]})


def record_from_json(content: Mapping[str, Any], mode: str) -> EpisodeRecord:
    """Returns the record from the JSON values of `record_to_json`.

    Args:
        content: JSON values.
        mode: Mode of the experiment.

    Raises:
        ValueError: A status is unknown.
        KeyError, TypeError: A field is missing.
    """
    spec = content["spec"]
    settings = stored_settings(mode, spec["settings"])
    return from_json(EpisodeRecord, {**content, "spec": EpisodeSpec(**{**spec, "settings": settings})})
