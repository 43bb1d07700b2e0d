# SPDX-License-Identifier: BSD-3-Clause
"""The keys of a machine's header, defined once: for the check of a task, for ``--explain`` and for the JSON Schema."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from modular_framework_core.state_api.option_types import or_reference
from modular_framework_core.task_constructor.template_catalogue import TemplateSource

SHARED_USERDATA = "self.userdata"
NAMES = {"type": "array", "items": {"type": "string"}, "uniqueItems": True}
UNREAD = ("params", "states", "anchors")
"""Keys whose references are not resolved with the header's: they are read later, or not at all."""
OUTCOMES = {**NAMES, "minItems": 1}
NAME_MAP = {"type": "object", "additionalProperties": {"type": "string"}}


@dataclass(frozen=True, slots=True)
class MachineKey:
    """A key of the header of a machine.

    Attributes:
        name: Spelling.
        form: What its value looks like, in words.
        meaning: What it is for.
        schema: JSON Schema of its value.
        at_root: Whether the task itself has it; ``nested`` whether a nested machine has it: "required", "optional" or
            "" for not at all.
        nested: See ``at_root``.
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
        "Name of the task and its file; of a nested machine, the name of its class, which is "
        "made of the label if left out.",
        {"type": "string"},
        at_root="required",
    ),
    MachineKey(
        "node_name",
        "a name",
        "Name of the ROS node that runs the task; the task's if left out.",
        {"type": "string"},
        nested="",
    ),
    MachineKey(
        "source",
        "a name",
        "The template the machine is written with: this one.",
        {"type": "string"},
        "required",
        "required",
    ),
    MachineKey(
        "outcomes",
        "a list of names",
        "What the machine may end with, first = success; success and fail if left out.",
        or_reference(OUTCOMES),
        at_root="required",
    ),
    MachineKey(
        "transitions",
        "a mapping {outcome: label, or outcome of the machine around}",
        "Where to go on after each outcome; none is needed for an outcome that the machine around has too.",
        or_reference(NAME_MAP),
        at_root="",
    ),
    MachineKey(
        "initial_state",
        "a label",
        "State that the machine begins with; the first one if left out.",
        or_reference({"type": "string"}),
    ),
    MachineKey(
        "default_outcome",
        "a name",
        "Outcome when no entry of the outcome map is met; the last one if left out.",
        {"type": "string"},
    ),
    MachineKey(
        "outcome_map",
        "a mapping {outcome: {label: outcome of that state}}",
        "Which outcomes of the states, together, give which outcome of the machine.",
        or_reference({"type": "object", "additionalProperties": NAME_MAP}),
    ),
    MachineKey(
        "userdata",
        SHARED_USERDATA,
        "Shares the userdata of the machine around; it has its own if left out.",
        {"const": SHARED_USERDATA},
        at_root="",
    ),
    MachineKey(
        "input_keys",
        "a list of names",
        "Userdata copied from the machine around when this one begins.",
        or_reference(NAMES),
        at_root="",
    ),
    MachineKey(
        "output_keys",
        "a list of names",
        "Userdata copied to the machine around when this one ends.",
        or_reference(NAMES),
        at_root="",
    ),
    MachineKey(
        "remapping",
        "a mapping {key in this machine: key in the machine around}",
        "Other names for its input and output keys in the machine around.",
        or_reference(NAME_MAP),
        at_root="",
    ),
    MachineKey(
        "anchors",
        "any value",
        "Values to refer to by YAML anchors (&name, *name, <<: *name); not read otherwise.",
        {},
        nested="",
    ),
    MachineKey(
        "external_names",
        "a mapping {kind of message: list of names}",
        "Messages that other nodes put into the "
        "managers while the task runs: joint_state, trajectory, pose, robot_pose, plan, grasp.",
        {"type": "object", "additionalProperties": NAMES},
        nested="",
    ),
    MachineKey(
        "params",
        "a mapping {key: any value}",
        "Values that everything below may use as params.<key>.",
        {"type": "object"},
    ),
    MachineKey(
        "states",
        "a list of '- Label: {source: ...}'",
        "The states and nested machines; the first one begins, in a concurrent machine all at once.",
        {"$ref": "#/definitions/states"},
        "required",
        "required",
    ),
)


def machine_keys(template: TemplateSource) -> list[MachineKey]:
    """Returns the keys of machines with a template, in the order they are usually written."""
    absent = {"initial_state"} if template.concurrent else {"default_outcome", "outcome_map"}
    absent |= set() if template.takes_keys else {"input_keys", "output_keys"}
    own = [
        MachineKey(name, "any value", f"Of this template, which reads it as options.{name}.", {})
        for name in sorted(template.options)
    ]
    return [*(key for key in _KEYS if key.name not in absent), *own]


def required_keys(*, is_root: bool) -> list[MachineKey]:
    """Returns the keys that no machine can do without."""
    return [key for key in _KEYS if (key.at_root if is_root else key.nested) == "required"]


def root_keys() -> list[str]:
    """Returns the names of the keys a task may have, whatever its template."""
    return [key.name for key in _KEYS if key.at_root]
