# SPDX-License-Identifier: BSD-3-Clause
"""Read access to parameters of controllers and hardware, with and without a ROS master.

`MappingNodeHandle` reads from a nested mapping (in tests and programs without a master), `RosNodeHandle` from the
parameter server; both implement the protocol `NodeHandle`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol


class ParameterError(Exception):
    """A parameter is missing or has a value that is not allowed."""


class NodeHandle(Protocol):
    """Read access to the parameters below one namespace."""

    @property
    def namespace(self) -> str:
        """The absolute namespace, for example "/" or "/arm_trajectory_controller"."""

    def has_param(self, key: str) -> bool:
        """Returns whether the parameter `key` (a relative name, separated by "/") is set."""

    def get_param(self, key: str, default: Any = None) -> Any:
        """Returns the value of `key`, or `default` if it is not set."""

    def child(self, name: str) -> NodeHandle:
        """Returns the handle of the namespace `name` below this namespace."""


def join_names(namespace: str, name: str) -> str:
    """Returns the absolute name of `name` below `namespace`, with single slashes."""
    parts = [part for part in f"{namespace}/{name}".split("/") if part]
    return "/" + "/".join(parts)


class MappingNodeHandle:
    """A node handle that reads from nested mappings.

    Args:
        parameters: Nested mapping of all parameters below `namespace`.
        namespace: Namespace used in messages.
    """

    def __init__(self, parameters: Mapping[str, Any] | None = None, namespace: str = "/") -> None:
        self._parameters: Mapping[str, Any] = parameters if parameters is not None else {}
        self._namespace = namespace

    @property
    def namespace(self) -> str:
        return self._namespace

    def _find(self, key: str) -> tuple[bool, Any]:
        value: Any = self._parameters
        for part in (part for part in key.split("/") if part):
            if not isinstance(value, Mapping) or part not in value:
                return False, None
            value = value[part]
        return True, value

    def has_param(self, key: str) -> bool:
        return self._find(key)[0]

    def get_param(self, key: str, default: Any = None) -> Any:
        is_set, value = self._find(key)
        return value if is_set else default

    def child(self, name: str) -> MappingNodeHandle:
        is_set, value = self._find(name)
        parameters = value if is_set and isinstance(value, Mapping) else {}
        return MappingNodeHandle(parameters, join_names(self._namespace, name))


def read_number(handle: NodeHandle, key: str, default: float, minimum: float | None = 0.0) -> float:
    """Returns a parameter that is a finite number.

    Args:
        handle: Node handle of the namespace.
        key: Relative name of the parameter.
        default: Value if the parameter is not set.
        minimum: Minimum allowed value; None for no bound.

    Raises:
        ParameterError: The value is not a finite number, or is below `minimum`.
    """
    value = handle.get_param(key, default)
    where = join_names(handle.namespace, key)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value or abs(value) == float("inf"):
        raise ParameterError(f"parameter {where}: got {value!r}; expected a finite number")
    if minimum is not None and value < minimum:
        raise ParameterError(f"parameter {where}: got {value!r}; expected a number of at least {minimum}")
    return float(value)


def read_bool(handle: NodeHandle, key: str, default: bool) -> bool:
    """Returns a boolean parameter.

    Args:
        handle: Node handle of the namespace.
        key: Relative name of the parameter.
        default: Value if the parameter is not set.

    Raises:
        ParameterError: The value is not true or false.
    """
    value = handle.get_param(key, default)
    if not isinstance(value, bool):
        raise ParameterError(f"parameter {join_names(handle.namespace, key)}: got {value!r}; expected true or false")
    return value


def read_names(handle: NodeHandle, key: str) -> list[str]:
    """Returns a parameter that is one name or a list of distinct names.

    Raises:
        ParameterError: The parameter is not set or empty, contains a value other than a name, or repeats a name.
    """
    value = handle.get_param(key)
    names = [value] if isinstance(value, str) else value
    where = join_names(handle.namespace, key)
    if not isinstance(names, (list, tuple)) or not names or not all(isinstance(name, str) and name for name in names):
        raise ParameterError(f"parameter {where}: got {value!r}; expected a list of joint names")
    if len(set(names)) != len(names):
        raise ParameterError(f"parameter {where}: got {value!r}; expected each joint name once")
    return list(names)
