# SPDX-License-Identifier: BSD-3-Clause
"""Selection of the node's endpoints: MoveIt's defaults, changed by the parameters of capabilities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import rospy

from modular_framework_planning.move_group.capabilities.capability import MoveGroupCapability
from modular_framework_planning.move_group.node_parameters import parameter
from modular_framework_ros.allowed_names import nearest

PIPELINES = "~planning_pipelines"


@dataclass(frozen=True, slots=True)
class Capability:
    """An endpoint that parameters can enable or disable.

    Attributes:
        name: Name of the MoveIt plugin with the same purpose.
        build: Class of the endpoint.
        default: Whether the endpoint is offered unless disabled; otherwise only if `capabilities` lists it.
    """

    name: str
    build: type[MoveGroupCapability]
    default: bool = True


def chosen_capabilities(table: Sequence[Capability]) -> list[type[MoveGroupCapability]]:
    """Selects endpoints by ~capabilities, ~planning_pipelines/*/capabilities and ~disable_capabilities.

    As in MoveIt, the parameters are lists separated by spaces, and an unknown name is only logged as a warning.
    """
    requested = [(rospy.resolve_name("~capabilities"), name) for name in _split(parameter("~capabilities"))]
    for pipeline, settings in (parameter(PIPELINES) or {}).items():
        if isinstance(settings, dict):
            requested += [
                (rospy.resolve_name(f"{PIPELINES}/{pipeline}/capabilities"), name)
                for name in _split(settings.get("capabilities", ""))
            ]
    disabled = [
        (rospy.resolve_name("~disable_capabilities"), name) for name in _split(parameter("~disable_capabilities"))
    ]
    known = list(dict.fromkeys(item.name for item in table))
    for source_name, name in (*requested, *disabled):
        if name not in known:
            rospy.logwarn(
                "%s: unknown capability '%s'; known: %s%s", source_name, name, ", ".join(known), nearest(name, known)
            )
    enabled, removed = ({name for _, name in items} for items in (requested, disabled))
    return [item.build for item in table if (item.default or item.name in enabled) and item.name not in removed]


def _split(value: object) -> list[str]:
    """Returns the words of a text parameter, or the items of a list parameter."""
    return [str(item) for item in value] if isinstance(value, list) else str(value or "").split()
