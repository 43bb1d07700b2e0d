# SPDX-License-Identifier: BSD-3-Clause
"""Lets the node's settings be adjusted while it runs, by dynamic_reconfigure as in MoveIt."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, TypeVar

import rospy

from modular_framework_planning.ros_context import MoveGroupContext

NO_LIMIT = 1.0e9
Settings = TypeVar("Settings")


@dataclass(frozen=True, slots=True)
class Adjustable:
    """A parameter that may be changed, under MoveIt's name and within MoveIt's range."""

    name: str
    lowest: bool | int | float
    highest: bool | int | float
    description: str

    @property
    def kind(self) -> str:
        """The type in dynamic_reconfigure's words."""
        return {bool: "bool", int: "int", float: "double"}[type(self.lowest)]

    def accepts(self, value: object) -> bool:
        """Whether a parameter's value is of the type and within the range."""
        if isinstance(value, bool) or isinstance(self.lowest, bool):
            return type(value) is type(self.lowest)
        return isinstance(value, type(self.lowest) | int) and self.lowest <= value <= self.highest


TABLES = {
    "trajectory_execution": (
        Adjustable("execution_duration_monitoring", False, True, "stop a motion that takes too long"),
        Adjustable("allowed_execution_duration_scaling", 1.0, 10.0, "too long is the planned time times this + margin"),
        Adjustable("allowed_goal_duration_margin", 0.1, 30.0, "margin beyond the planned time [s]"),
        Adjustable("execution_velocity_scaling", 0.1, 10.0, "how many times as fast as planned motions are executed"),
        Adjustable("allowed_start_tolerance", 0.0, NO_LIMIT, "of a joint from the first point [rad or m]; 0: any"),
        Adjustable("wait_for_trajectory_completion", False, True, "wait until the joints stand still")),
    "planning_scene_monitor": (
        Adjustable("publish_planning_scene", False, True, "tell changes of the scene"),
        Adjustable("publish_planning_scene_hz", 0.1, 100.0, "how often joints and frames are told while they change"),
        Adjustable("publish_geometry_updates", False, True, "tell changes of objects"),
        Adjustable("publish_state_updates", False, True, "tell changes of joints"),
        Adjustable("publish_transforms_updates", False, True, "tell changes of frames outside the robot")),
    "plan_execution": (
        Adjustable("max_replan_attempts", 0, 1000, "plans of a goal that asks for replanning and gives no number"),
        Adjustable("record_trajectory_state_frequency", 0.0, 1000.0, "of the executed trajectory [Hz]; 0: none")),
    "pick_place": (
        Adjustable("max_attempted_states_per_pose", 1, 100, "postures of the arm tried for one grasp or place"),
        Adjustable("cartesian_motion_step_size", 0.005, 0.1, "between the poses solved on a straight line [m]")),
    "ompl": (Adjustable("simplify_solutions", False, True, "shorten the paths that are found"),),
}


class Reconfiguration:
    """Serves ~NAMESPACE/{set_parameters, parameter_descriptions, parameter_updates}."""

    def __init__(self, namespace: str, holder: Any, attribute: str) -> None:
        """Takes what is adjusted.

        Args:
            namespace: below the node's own; TABLES says which settings may be changed.
            holder, attribute: where the settings are, a frozen dataclass that is replaced as a whole.
        """
        self._namespace, self._table = namespace, TABLES[namespace]
        self._holder, self._attribute = holder, attribute

    def connect(self) -> None:
        """Starts to serve. A set-up without the Python package dynamic_reconfigure goes without, and says so."""
        try:
            from dynamic_reconfigure.server import Server
        except ImportError as error:
            rospy.logwarn("%s cannot be adjusted while the node runs: %s; install python3-dynamic-reconfigure",
                          rospy.resolve_name(f"~{self._namespace}"), error)
            return
        settings = getattr(self._holder, self._attribute)
        defaults = {item.name: getattr(settings, item.name) for item in self._table}
        for name, value in defaults.items():  # the server reads them, and knows no faulty ones
            rospy.set_param(f"~{self._namespace}/{name}", value)
        self._server = Server(described(self._table, defaults), self._adjust, self._namespace)

    def _adjust(self, config: Any, _level: int) -> Any:
        present = getattr(self._holder, self._attribute)
        changed = {item.name: config[item.name] for item in self._table
                   if getattr(present, item.name) != config[item.name]}
        if changed:
            setattr(self._holder, self._attribute, replace(present, **changed))
            rospy.loginfo("%s: %s", self._namespace, ", ".join(f"{name} is now {value}"
                                                               for name, value in changed.items()))
        return config


def reconfigurations(context: MoveGroupContext) -> tuple[Reconfiguration, ...]:
    """Returns a server for each part of the node that may be adjusted."""
    return (Reconfiguration("trajectory_execution", context.execution, "settings"),
            Reconfiguration("planning_scene_monitor", context.monitor, "settings"),
            Reconfiguration("plan_execution", context.settings, "plan_execution"),
            Reconfiguration("pick_place", context.settings, "pick_place"),
            Reconfiguration("ompl", context.pipelines, "sampling_settings"))


def given_settings(namespace: str, settings: Settings) -> Settings:
    """Returns the settings with what the parameters give; a faulty value is an error in the log and left out."""
    values = {}
    for item in TABLES[namespace]:
        name, default = f"~{namespace}/{item.name}", getattr(settings, item.name)
        value = rospy.get_param(name, default)
        if item.accepts(value):
            values[item.name] = value
        else:
            rospy.logerr("%s is %r; allowed is %s of %s to %s; %s is used", rospy.resolve_name(name), value, item.kind,
                         item.lowest, item.highest, default)
    return replace(settings, **values)  # type: ignore[type-var]


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
