# SPDX-License-Identifier: BSD-3-Clause
"""Selects the endpoints the node offers: MoveIt's default set, plus and minus those that parameters name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import rospy

from modular_framework_planning.move_group.capabilities.capability import MoveGroupCapability
from modular_framework_planning.move_group.node_parameters import parameter

PIPELINES = "~planning_pipelines"


@dataclass(frozen=True, slots=True)
class Capability:
    """An endpoint that parameters may name.

    Attributes:
        name: as MoveIt's plugin of the same purpose.
        build: its class.
        default: offered unless `disable_capabilities` names it; otherwise only where `capabilities` does.
    """

    name: str
    build: type[MoveGroupCapability]
    default: bool = True


def chosen_capabilities(table: Sequence[Capability]) -> list[type[MoveGroupCapability]]:
    """Reads ~capabilities, ~planning_pipelines/*/capabilities and ~disable_capabilities, each separated by spaces.

    An unknown name is a warning with the list of those that are known, as in MoveIt.
    """
    wanted = [(rospy.resolve_name("~capabilities"), name) for name in _split(parameter("~capabilities"))]
    for pipeline, settings in (parameter(PIPELINES) or {}).items():
        if isinstance(settings, dict):
            wanted += [
                (rospy.resolve_name(f"{PIPELINES}/{pipeline}/capabilities"), name)
                for name in _split(settings.get("capabilities", ""))
            ]
    disabled = [
        (rospy.resolve_name("~disable_capabilities"), name) for name in _split(parameter("~disable_capabilities"))
    ]
    known = list(dict.fromkeys(item.name for item in table))
    for where, name in (*wanted, *disabled):
        if name not in known:
            rospy.logwarn("%s names '%s', which is not offered; known: %s", where, name, ", ".join(known))
    added, dropped = ({name for _, name in items} for items in (wanted, disabled))
    return [item.build for item in table if (item.default or item.name in added) and item.name not in dropped]


def _split(value: object) -> list[str]:
    """Splits a parameter; a list is taken as it is."""
    return [str(item) for item in value] if isinstance(value, list) else str(value or "").split()
