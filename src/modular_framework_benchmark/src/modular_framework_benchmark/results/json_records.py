# SPDX-License-Identifier: BSD-3-Clause
"""Converts descriptions and records to JSON text and back."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from enum import Enum
from pathlib import PurePath
from typing import Any

from modular_framework_benchmark.experiments.modes import stored_settings
from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus, Span
from modular_framework_benchmark.records.episode_settings import as_json
from modular_framework_benchmark.records.experiment import Direction, ExperimentDescription, Factor, Metric, MetricKind
from modular_framework_ros.reported_figures import Clock, Source


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
    content = json.loads(text)
    factors = tuple(Factor(each["name"], tuple(each["levels"])) for each in content.pop("factors"))
    metrics = tuple(
        Metric(
            **{
                **each,
                "kind": MetricKind(each["kind"]),
                "better": Direction(each["better"]),
                "clock": None if each["clock"] is None else Clock(each["clock"]),
                "source": Source(each["source"]),
            }
        )
        for each in content.pop("metrics")
    )
    return ExperimentDescription(**content, factors=factors, metrics=metrics)


def record_to_json(record: EpisodeRecord) -> str:
    """Returns a record and its episode's specification as JSON."""
    spec = record.spec
    return to_json(
        {
            "spec": {name: getattr(spec, name) for name in ("number", "configuration", "trial", "seed", "settings")},
            "status": record.status,
            "outcome": record.outcome,
            "cause": record.cause,
            "begun": record.begun,
            "wall_s": record.wall_s,
            "simulated_s": record.simulated_s,
            "metrics": record.metrics,
            "spans": [asdict(span) for span in record.spans],
            "snapshot": record.snapshot,
            "folder": record.folder,
            "worker": record.worker,
        }
    )


def record_from_json(content: Mapping[str, Any], mode: str) -> EpisodeRecord:
    """Returns the record from the JSON values of `record_to_json`.

    Args:
        content: JSON values.
        mode: Mode of the experiment.

    Raises:
        ValueError: A status is unknown.
        KeyError, TypeError: A field is missing or unknown.
    """
    spec = content["spec"]
    return EpisodeRecord(
        **{
            **content,
            "spec": EpisodeSpec(**{**spec, "settings": stored_settings(mode, spec["settings"])}),
            "status": EpisodeStatus(content["status"]),
            "spans": tuple(Span(**span) for span in content["spans"]),
        }
    )
