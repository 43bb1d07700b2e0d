# SPDX-License-Identifier: BSD-3-Clause
"""Header keys of a machine, defined once for the checks, ``--explain`` and the JSON Schema."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from modular_framework_core.state_api.option_types import or_reference
from modular_framework_core.task_constructor.template_catalogue import TemplateSource

SHARED_USERDATA = "self.userdata"
NAMES = {"type": "array", "items": {"type": "string"}, "uniqueItems": True}
UNREAD = ("params", "states", "anchors")
"""Keys whose references are resolved later than the header's, or not at all."""
OUTCOMES = {**NAMES, "minItems": 1}
NAME_MAP = {"type": "object", "additionalProperties": {"type": "string"}}


@dataclass(frozen=True, slots=True)
class MachineKey:
    """A key of a machine's header.

    Attributes:
        name: Spelling.
        form: Description of the value's form.
        meaning: Purpose of the key.
        schema: JSON Schema of the value.
        at_root: Use in the task's own header: "required", "optional" or "" (not allowed).
        nested: Use in the header of a nested machine, with the same values.
    """

    name: str
    form: str
    meaning: str
    schema: dict[str, Any]
    at_root: str = "optional"
    nested: str = "optional"


_KEYS = (
    MachineKey(
        "name",
        "a name",
        "Name of the task and of the generated file; in a nested machine, the class name, by default "
        "derived from the label.",
        {"type": "string"},
        at_root="required",
    ),
    MachineKey(
        "node_name",
        "a name",
        "Name of the ROS node that runs the task; by default the task's name.",
        {"type": "string"},
        nested="",
    ),
    MachineKey(
        "source",
        "a name",
        "Template of the machine.",
        {"type": "string"},
        "required",
        "required",
    ),
    MachineKey(
        "outcomes",
        "a list of names",
        "Outcomes of the machine; the first is positive. Default: success and fail.",
        or_reference(OUTCOMES),
        at_root="required",
    ),
    MachineKey(
        "transitions",
        "a mapping {outcome: label, or outcome of the enclosing machine}",
        "Next state after each outcome. An outcome that the enclosing machine has too needs no entry.",
        or_reference(NAME_MAP),
        at_root="",
    ),
    MachineKey(
        "initial_state",
        "a label",
        "Initial state of the machine; by default the first state.",
        or_reference({"type": "string"}),
    ),
    MachineKey(
        "default_outcome",
        "a name",
        "Outcome if no entry of the outcome map matches; by default the last outcome.",
        {"type": "string"},
    ),
    MachineKey(
        "outcome_map",
        "a mapping {outcome: {label: outcome of that state}}",
        "Outcome of the machine for each combination of the states' outcomes.",
        or_reference({"type": "object", "additionalProperties": NAME_MAP}),
    ),
    MachineKey(
        "userdata",
        SHARED_USERDATA,
        "Shares the enclosing machine's userdata; by default the machine has its own.",
        {"const": SHARED_USERDATA},
        at_root="",
    ),
    MachineKey(
        "input_keys",
        "a list of names",
        "Userdata copied from the enclosing machine at the start.",
        or_reference(NAMES),
        at_root="",
    ),
    MachineKey(
        "output_keys",
        "a list of names",
        "Userdata copied to the enclosing machine at the end.",
        or_reference(NAMES),
        at_root="",
    ),
    MachineKey(
        "remapping",
        "a mapping {key in this machine: key in the enclosing machine}",
        "Names of the input and output keys in the enclosing machine.",
        or_reference(NAME_MAP),
        at_root="",
    ),
    MachineKey(
        "anchors",
        "any value",
        "Place for YAML anchors (&name, *name, <<: *name); ignored otherwise.",
        {},
        nested="",
    ),
    MachineKey(
        "external_names",
        "a mapping {kind of message: list of names}",
        "Messages that other nodes store in the "
        "managers while the task runs: joint_state, trajectory, pose, robot_pose, plan, grasp.",
        {"type": "object", "additionalProperties": NAMES},
        nested="",
    ),
    MachineKey(
        "params",
        "a mapping {key: any value}",
        "Values for use as params.<key> anywhere inside the machine.",
        {"type": "object"},
    ),
    MachineKey(
        "states",
        "a list of '- Label: {source: ...}'",
        "States and nested machines. The first runs first; in a concurrent machine all run at once.",
        {"$ref": "#/definitions/states"},
        "required",
        "required",
    ),
)


def machine_keys(template: TemplateSource) -> list[MachineKey]:
    """Returns the header keys of machines with a template, in their usual order."""
    absent = {"initial_state"} if template.concurrent else {"default_outcome", "outcome_map"}
    absent |= set() if template.takes_keys else {"input_keys", "output_keys"}
    template_keys = [
        MachineKey(name, "any value", f"Option of this template, available in the template as options.{name}.", {})
        for name in sorted(template.options)
    ]
    return [*(key for key in _KEYS if key.name not in absent), *template_keys]


def required_keys(*, is_root: bool) -> list[MachineKey]:
    """Returns the required keys."""
    return [key for key in _KEYS if (key.at_root if is_root else key.nested) == "required"]


def root_keys() -> list[str]:
    """Returns the names of all keys that a task's header may have with any template."""
    return [key.name for key in _KEYS if key.at_root]
