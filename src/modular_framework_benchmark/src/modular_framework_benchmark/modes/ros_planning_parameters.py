# SPDX-License-Identifier: BSD-3-Clause
"""Reads the ROS parameters of the mode `planning`: the parameters of the planning pipeline."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.modes.parameters import parameters_below
from modular_framework_core.launching.ros_launch_preview import leaves
from modular_framework_ros.allowed_names import nearest
from modular_framework_ros.parameter_declarations import existing_declaration

NODE_NAMESPACE = "/move_group/"
UNSUPPORTED_PARAMETERS = {"seed": "each episode has its own seed", "capabilities": "this mode starts no move_group"}
"""Parameters of a pipeline without effect in this mode, and the reason."""


def pipeline_parameters(parameters: Mapping[str, Any], pipeline: str) -> dict[str, Any]:
    """Returns the nested parameters of a pipeline, which take precedence over parameters of the node.

    Args:
        parameters: Values by full name.
        pipeline: Name of the pipeline.

    Raises:
        ModeError: The mode ignores some parameters, which the message lists.
    """
    own, values = f"{NODE_NAMESPACE}planning_pipelines/{pipeline}/", leaves(parameters)
    declared = existing_declaration("modular_framework_planning", "planning_pipeline").parameters
    read = [
        f"{parent}{key}" for parent in (own, NODE_NAMESPACE) for key in declared if key not in UNSUPPORTED_PARAMETERS
    ]
    faults = []
    for name in values:
        key = name.removeprefix(own).removeprefix(NODE_NAMESPACE).partition("/")[0]
        is_read = name.startswith(own) or (name.startswith(NODE_NAMESPACE) and key in declared)
        if not is_read or key in UNSUPPORTED_PARAMETERS:
            reason = UNSUPPORTED_PARAMETERS[key] if is_read else f"allowed: names below {own}{nearest(name, read)}"
            faults.append(f"parameter '{name}' has no effect in this mode; {reason}")
    if faults:
        raise ModeError("; ".join(faults))
    return parameters_below(values, (NODE_NAMESPACE, own))
