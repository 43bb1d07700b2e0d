# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of a grasp method from an experiment file, without a parameter server."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_ros.allowed_names import listing, nearest
from modular_framework_ros.parameter_declarations import NodeDeclaration


class GivenParameters:
    """Reads given or default parameters; implements `ReadNumber` of the grasp methods.

    Args:
        values: Values by name, without the ~ of private parameters.
        declared: Parameters that the method declares.

    Raises:
        ModeError: The method does not declare a parameter, or a value is not allowed.
    """

    def __init__(self, values: Mapping[str, Any], declared: NodeDeclaration) -> None:
        own = {name[1:]: item for name, item in declared.parameters.items() if name.startswith("~")}
        faults = []
        for name, value in values.items():
            if name not in own:
                faults.append(f"the method has no '{name}'; {listing(sorted(own))}{nearest(name, own)}")
            elif own[name].fault(value):
                faults.append(f"'{name}' {own[name].fault(value)}")
        if faults:
            raise ModeError(f"method_parameters: {'; '.join(faults)}")
        self._values = {name: values.get(name, item.default) for name, item in own.items()}

    def __call__(self, name: str) -> Any:
        """Returns the given value of a parameter, or its default."""
        return self._values[name.removeprefix("~")]
