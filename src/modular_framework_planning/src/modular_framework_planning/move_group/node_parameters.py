# SPDX-License-Identifier: BSD-3-Clause
"""Access to the parameters of move_group that `parameters/move_group.yaml` declares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import cache
from typing import Any, TypeVar

from modular_framework_ros.declared_parameters import DeclaredParameters

Settings = TypeVar("Settings")


@cache
def declared_parameters() -> DeclaredParameters:
    """Returns the declared parameters of the node."""
    return DeclaredParameters("modular_framework_planning", "move_group")


def parameter(name: str) -> Any:
    """Returns a parameter; as in MoveIt, an invalid value is logged as an error and replaced by the default."""
    return declared_parameters().value_or_default(name)


def settings_below(namespace: str, kind: Callable[..., Settings]) -> Settings:
    """Returns a settings object with one attribute per parameter below a private namespace."""
    return kind(**{item.name: parameter(f"~{namespace}/{item.name}") for item in fields(kind)})  # type: ignore[arg-type]
