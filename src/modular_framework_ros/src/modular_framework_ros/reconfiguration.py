# SPDX-License-Identifier: BSD-3-Clause
"""Serves dynamic_reconfigure for settings of a running node, without generated code."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import rospy
from dynamic_reconfigure.server import Server

from modular_framework_ros.parameter_declarations import ParameterReader


@dataclass(frozen=True, slots=True)
class Adjustable:
    """A parameter that may be changed at run time.

    Attributes:
        name: Public name.
        lowest, highest: Public range.
        description: Meaning and unit.
    """

    name: str
    lowest: bool | int | float
    highest: bool | int | float
    description: str

    @property
    def type_name(self) -> str:
        """Type name of dynamic_reconfigure."""
        return {bool: "bool", int: "int", float: "double"}[type(self.lowest)]


def adjustable(parameters: ParameterReader, namespace: str) -> tuple[Adjustable, ...]:
    """Returns the declared parameters below a namespace that may be changed at run time.

    Args:
        parameters: Parameters of the node.
        namespace: Namespace with a trailing slash.
    """
    as_kind = {"bool": bool, "int": int, "float": float}
    return tuple(
        Adjustable(item.name.removeprefix(namespace), *map(as_kind[item.type], item.adjustable), item.doc)
        for item in parameters.declarations()
        if item.adjustable and item.name.startswith(namespace)
    )


class _Server(Server):
    """A server that rejects values that are not finite; dynamic_reconfigure accepts NaN and clamps infinity.

    Attributes:
        caller: Name of the node that sent the latest request; "" before the first request.
    """

    caller = ""

    def _set_callback(self, req: Any) -> Any:
        self.caller = str(req._connection_header.get("callerid", ""))
        return super()._set_callback(req)

    def _clamp(self, config: Any) -> None:
        for name, present in self.type.defaults.items():
            present = self.config.get(name, present)
            if not math.isfinite(config[name]):
                rospy.logerr(
                    "%s%s: got %s; allowed: %s to %s; %s stays",
                    rospy.resolve_name(self.ns) + "/",
                    name,
                    config[name],
                    self.type.min[name],
                    self.type.max[name],
                    present,
                )
                config[name] = present
        super()._clamp(config)


class Reconfiguration:
    """Serves NAMESPACE/{set_parameters, parameter_descriptions, parameter_updates}."""

    def __init__(self, namespace: str, table: Sequence[Adjustable], holder: Any, attribute: str) -> None:
        """Stores the adjustable parameters.

        Args:
            namespace: Absolute namespace, or a namespace that begins with "~".
            table: Adjustable parameters.
            holder: Object that has the settings.
            attribute: Name of the holder's attribute with the settings. The settings are a frozen dataclass that is
                replaced as a whole, so that readers never see a mixture of old and new settings.
        """
        self._namespace, self._table = namespace, tuple(table)
        self._holder, self._attribute = holder, attribute
        self._server: _Server | None = None

    @property
    def caller(self) -> str:
        """Name of the node that sent the latest request; "" before the first request."""
        return self._server.caller if self._server is not None else ""

    def connect(self) -> None:
        """Starts the server."""
        settings = getattr(self._holder, self._attribute)
        defaults = {item.name: getattr(settings, item.name) for item in self._table}
        for name, value in defaults.items():  # the server reads these parameters and does not check them
            rospy.set_param(f"{self._namespace}/{name}", value)
        self._server = _Server(described_parameters(self._table, defaults), self._adjust, self._namespace)

    def refresh(self) -> None:
        """Publishes the current settings after a change by other means; does nothing before `connect`."""
        if self._server is None:
            return
        settings = getattr(self._holder, self._attribute)
        values = {item.name: getattr(settings, item.name) for item in self._table}
        if any(self._server.config[name] != value for name, value in values.items()):
            self._server.update_configuration(values)

    def close(self) -> None:
        """Stops the server; may be called twice."""
        server, self._server = self._server, None
        if server is not None:
            server.set_service.shutdown("its owner was closed")
            server.descr_topic.unregister()
            server.update_topic.unregister()

    def _adjust(self, config: Any, _level: int) -> Any:
        present = getattr(self._holder, self._attribute)
        changed = {
            item.name: config[item.name] for item in self._table if getattr(present, item.name) != config[item.name]
        }
        if changed:
            setattr(self._holder, self._attribute, replace(present, **changed))
            rospy.loginfo(
                "%s: %s", self._namespace, ", ".join(f"{name} is now {value}" for name, value in changed.items())
            )
        return config


def described_parameters(parameters: Sequence[Adjustable], defaults: dict[str, Any]) -> SimpleNamespace:
    """Returns the equivalent of the module that dynamic_reconfigure generates from a .cfg file.

    Ranges are extended to the configured values, so that starting the server changes nothing.
    """
    lowest = {item.name: min(item.lowest, defaults[item.name]) for item in parameters}
    highest = {item.name: max(item.highest, defaults[item.name]) for item in parameters}
    entries = [
        {
            "name": item.name,
            "type": item.type_name,
            "level": 1,
            "description": item.description,
            "default": defaults[item.name],
            "min": lowest[item.name],
            "max": highest[item.name],
            "edit_method": "",
        }
        for item in parameters
    ]
    group = {
        "name": "Default",
        "type": "",
        "state": True,
        "cstate": "true",
        "id": 0,
        "parent": 0,
        "parentname": "",
        "class": "DEFAULT",
        "parentclass": "",
        "field": "default",
        "upper": "DEFAULT",
        "lower": "groups",
        "parameters": entries,
        "groups": [],
    }
    return SimpleNamespace(
        config_description=group,
        defaults=dict(defaults),
        min=lowest,
        max=highest,
        level={item.name: 1 for item in parameters},
    )
