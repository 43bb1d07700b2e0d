# SPDX-License-Identifier: BSD-3-Clause
"""Describes the task language as a JSON Schema, so that editors can complete and check task scripts."""

from __future__ import annotations

from typing import Any

from modular_framework_core.state_api.constructor_keys import STATE_KEYS
from modular_framework_core.state_api.option_types import or_reference
from modular_framework_core.task_constructor.explanation import option_meanings
from modular_framework_core.task_constructor.machine_files import SUFFIX
from modular_framework_core.task_constructor.machine_keys import NAME_MAP, NAMES, OUTCOMES, machine_keys
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue, StateSource, StateSourceError
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue, TemplateSource

DRAFT = "http://json-schema.org/draft-07/schema#"


def task_schema(states: StateCatalogue, templates: TemplateCatalogue) -> dict[str, Any]:
    """Returns the JSON Schema (draft 7) of tasks with these states and templates.

    Unreadable states are omitted. A schema cannot express links between labels, such as the target of a transition;
    ``state_machine_generator --check`` covers them.
    """
    usable_states = [source for name in states.names() if (source := _readable(states, name)) is not None]
    usable_templates = [template for name in templates.names() if (template := templates.get(name)) is not None]
    definitions = {
        "state": {
            "oneOf": [{"$ref": f"#/definitions/state_{source.name}"} for source in usable_states]
            + [{"$ref": f"#/definitions/machine_{template.name}"} for template in usable_templates]
            + [{"$ref": "#/definitions/machine_file"}]
        },
        "states": {
            "type": "array",
            "minItems": 1,
            "items": {
                "type": "object",
                "minProperties": 1,
                "maxProperties": 1,
                "additionalProperties": {"$ref": "#/definitions/state"},
            },
        },
        "machine_file": {
            "type": "object",
            "description": "Machine in a file of its own.",
            "properties": {
                "source": {"type": "string", "pattern": f"\\{SUFFIX}$"},
                "params": {"type": "object"},
                "transitions": or_reference(NAME_MAP),
                "remapping": or_reference(NAME_MAP),
            },
            "required": ["source"],
            "additionalProperties": False,
        },
        **{f"state_{source.name}": _state(source) for source in usable_states},
        **{f"machine_{template.name}": _machine(template, is_root=False) for template in usable_templates},
    }
    return {
        "$schema": DRAFT,
        "title": "Task of the task constructor",
        "definitions": definitions,
        "oneOf": [_machine(template, is_root=True) for template in usable_templates],
    }


def _readable(states: StateCatalogue, name: str) -> StateSource | None:
    try:
        return states.get(name)
    except StateSourceError:
        return None


def _state(source: StateSource) -> dict[str, Any]:
    properties: dict[str, Any] = {
        "source": {"enum": [source.name, f"state_{source.name}"]},
        "transitions": or_reference(NAME_MAP),
        "remapping": or_reference(NAME_MAP),
        "params": {"type": "object"},
    }
    meanings = option_meanings(source.doc)
    for option in source.options.values():
        kind = OUTCOMES if option.name == "outcomes" else NAMES if option.name in STATE_KEYS else option.type.schema()
        properties[option.name] = {**or_reference(kind), "description": meanings.get(option.name, "")}
        if option.default_known:
            properties[option.name]["default"] = option.default
    return {
        "type": "object",
        "description": source.doc.split("\n\n")[0],
        "properties": properties,
        "required": ["source"],
        "additionalProperties": source.takes_any_option,
    }


def _machine(template: TemplateSource, *, is_root: bool) -> dict[str, Any]:
    keys = machine_keys(template)
    uses = {key.name: key.at_root if is_root else key.nested for key in keys}
    properties = {key.name: {**key.schema, "description": key.meaning} for key in keys if uses[key.name]}
    properties["source"] = {"const": template.name}
    return {
        "type": "object",
        "description": template.doc.split("\n\n")[0],
        "properties": properties,
        "required": [name for name, use in uses.items() if use == "required"],
        "additionalProperties": False,
    }
