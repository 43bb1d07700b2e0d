# SPDX-License-Identifier: BSD-3-Clause
"""Reads a catalogue of models, such as ``config/catalogue.yaml``, whose keys are the attributes of `Body`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from modular_framework_description.solids import Body, Part, ring_of_boxes


class CatalogueError(ValueError):
    """A catalogue is invalid; the message names the file and the model."""


def read_catalogue(path: Path) -> dict[str, tuple[Body, ...]]:
    """Returns the bodies of a catalogue by group.

    Args:
        path: YAML file with a list of models per group, and below ``sources`` the texts for the key ``source``.

    Raises:
        CatalogueError: The file is not a catalogue, or a model has an invalid key or value.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        sources = content.pop("sources", {})
        return {group: tuple(_body(entry, sources) for entry in entries) for group, entries in content.items()}
    except (OSError, yaml.YAMLError, AttributeError, TypeError, ValueError) as error:
        raise CatalogueError(f"{path}: {error}") from error


def _body(entry: dict[str, Any], sources: dict[str, str]) -> Body:
    values: dict[str, Any] = {key: tuple(item) if isinstance(item, list) else item for key, item in entry.items()}
    source = values.pop("source", "")
    try:
        values["parts"] = tuple(part for item in values["parts"] for part in _read_parts(dict(item)))
        values["description"] += f" Source: {sources[source]}." if source else ""
        return Body(**values)
    except (KeyError, TypeError, ValueError) as error:
        raise CatalogueError(f"model '{entry.get('name', '')}': {type(error).__name__}: {error}") from error


def _read_parts(item: dict[str, Any]) -> tuple[Part, ...]:
    pose = {key: tuple(item.pop(key)) for key in ("xyz", "rpy") if key in item}
    ((kind, size),) = item.items()
    return ring_of_boxes(**size) if kind == "ring" else (Part(kind, tuple(size), **pose),)
