# SPDX-License-Identifier: BSD-3-Clause
"""Lets trajectory execution be adjusted while the node runs, by dynamic_reconfigure as in MoveIt."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from types import SimpleNamespace
from typing import Any

import rospy

from modular_framework_planning.ros_execution import TrajectoryExecution

NAMESPACE = "trajectory_execution"
NO_LIMIT = 1.0e9


@dataclass(frozen=True, slots=True)
class Adjustable:
    """A parameter that may be changed, under MoveIt's name and within MoveIt's range."""

    name: str
    lowest: bool | float
    highest: bool | float
    description: str

    @property
    def kind(self) -> str:
        """The type in dynamic_reconfigure's words."""
        return "bool" if isinstance(self.lowest, bool) else "double"


ADJUSTABLE = (
    Adjustable("execution_duration_monitoring", False, True, "stop a motion that takes too long"),
    Adjustable("allowed_execution_duration_scaling", 1.0, 10.0, "too long is the planned time times this, plus margin"),
    Adjustable("allowed_goal_duration_margin", 0.1, 30.0, "margin beyond the planned time [s]"),
    Adjustable("execution_velocity_scaling", 0.1, 10.0, "how many times as fast as planned motions are executed"),
    Adjustable("allowed_start_tolerance", 0.0, NO_LIMIT, "distance of a joint from the first point [rad or m]; 0: any"),
    Adjustable("wait_for_trajectory_completion", False, True, "wait until the joints stand still"),
)


class ExecutionReconfiguration:
    """Serves ~trajectory_execution/{set_parameters, parameter_descriptions, parameter_updates}."""

    def __init__(self, execution: TrajectoryExecution) -> None:
        self._execution = execution

    def connect(self) -> None:
        """Starts to serve. A set-up without the Python package dynamic_reconfigure goes without, and says so."""
        try:
            from dynamic_reconfigure.server import Server
        except ImportError as error:
            rospy.logwarn("trajectory execution cannot be adjusted while it runs: %s; install "
                          "python3-dynamic-reconfigure", error)
            return
        defaults = {item.name: getattr(self._execution.settings, item.name) for item in ADJUSTABLE}
        for name, value in defaults.items():  # the server reads them, and knows no faulty ones
            rospy.set_param(f"~{NAMESPACE}/{name}", value)
        self._server = Server(described(ADJUSTABLE, defaults), self._adjust, NAMESPACE)

    def _adjust(self, config: Any, _level: int) -> Any:
        wanted = {item.name: config[item.name] for item in ADJUSTABLE}
        present = asdict(self._execution.settings)
        changed = {name: value for name, value in wanted.items() if present[name] != value}
        if changed:
            self._execution.settings = replace(self._execution.settings, **changed)
            rospy.loginfo("trajectory execution: %s", ", ".join(f"{name} is now {value}"
                                                                for name, value in changed.items()))
        return config


def described(parameters: Sequence[Adjustable], defaults: dict[str, Any]) -> SimpleNamespace:
    """Returns what dynamic_reconfigure's server takes for the module its generator makes of a .cfg file.

    Ranges are widened to what is configured, so that starting the server changes nothing.
    """
    lowest = {item.name: min(item.lowest, defaults[item.name]) for item in parameters}
    highest = {item.name: max(item.highest, defaults[item.name]) for item in parameters}
    entries = [{"name": item.name, "type": item.kind, "level": 1, "description": item.description,
                "default": defaults[item.name], "min": lowest[item.name], "max": highest[item.name],
                "edit_method": ""}
               for item in parameters]
    group = {"name": "Default", "type": "", "state": True, "cstate": "true", "id": 0, "parent": 0, "parentname": "",
             "class": "DEFAULT", "parentclass": "", "field": "default", "upper": "DEFAULT", "lower": "groups",
             "parameters": entries, "groups": []}
    return SimpleNamespace(config_description=group, defaults=dict(defaults),
                           min=lowest, max=highest, level={item.name: 1 for item in parameters})
