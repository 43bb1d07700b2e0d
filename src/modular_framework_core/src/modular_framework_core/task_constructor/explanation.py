# SPDX-License-Identifier: BSD-3-Clause
"""Describes states and templates for ``--explain``, from their signatures, docstrings and header keys."""

from __future__ import annotations

import inspect
import re
import textwrap

from modular_framework_core.state_api.constructor_keys import KEY_MEANINGS, STATE_KEYS
from modular_framework_core.task_constructor.generator import GenerationError, literal
from modular_framework_core.task_constructor.machine_keys import MachineKey, machine_keys
from modular_framework_core.task_constructor.state_catalogue import StateOption, StateSource
from modular_framework_core.task_constructor.template_catalogue import TemplateSource

_WIDTH = 110
_SECTION = re.compile(r"^(Args|Arguments|Raises|Returns|Attributes|Example|Examples):\s*$", re.MULTILINE)
_ENTRY = re.compile(r"^(\w+)(?: \([^)]*\))?:\s*(.*)$")
_STATE_KEYS_ENTRY = "**keys"


def explain(source: StateSource) -> str:
    """Returns the description of a state: purpose, options with types and defaults, outcomes and userdata."""
    doc = inspect.cleandoc(source.doc)
    section = _SECTION.search(doc)
    summary = (doc[: section.start()] if section else doc).strip() or "(its class has no docstring)"
    meanings = option_meanings(doc)
    lines = [f"{source.name}: {source.class_name}, {source.file}", "", summary, "", "Options:"]
    for option in source.options.values():
        if option.name not in STATE_KEYS:
            lines += _option(option, meanings.get(option.name, ""))
    if source.takes_any_option:
        lines.append("  and any other option; its constructor takes further keyword arguments")
    lines += ["", f"Outcomes: {_names(source, 'outcomes')}"]
    lines += [f"{key.replace('_', ' ').capitalize()}: {_names(source, key)}" for key in STATE_KEYS[1:]]
    return "\n".join(lines)


def explain_template(template: TemplateSource) -> str:
    """Returns the description of a template: purpose, header keys and provided userdata."""
    lines = [
        f"{template.name}: template, {template.file}",
        "",
        template.doc or "(its class has no docstring)",
        "",
        "Keys of the task, or of a nested machine:",
    ]
    for key in machine_keys(template):
        lines += [f"  {key.name}: {key.form}, {_use_text(key)}", *_indented_lines(key.meaning)]
    userdata = "unknown" if template.userdata is None else ", ".join(sorted(template.userdata))
    lines += ["", *textwrap.wrap(f"Userdata provided: {userdata or 'none'}", _WIDTH, subsequent_indent="  ")]
    return "\n".join(lines)


def option_meanings(doc: str) -> dict[str, str]:
    """Returns the entry of each option in a docstring's Args section, on one line.

    An entry ``**keys`` expands to the outcomes and userdata keys of every state.
    """
    parts = _SECTION.split(inspect.cleandoc(doc))
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    meanings: dict[str, str] = {}
    name = ""
    for line in textwrap.dedent(sections.get("Args", sections.get("Arguments", ""))).splitlines():
        entry = _ENTRY.match(line)
        if line.startswith(_STATE_KEYS_ENTRY):
            name, meanings = "", meanings | KEY_MEANINGS
        elif entry:
            name, meanings[entry[1]] = entry[1], entry[2].strip()
        elif name and line.startswith(" "):
            meanings[name] = f"{meanings[name]} {line.strip()}"
    return meanings


def _option(option: StateOption, meaning: str) -> list[str]:
    text = f"  {option.name}: {option.type.describe()}, {_default_text(option)}"
    return [text, *_indented_lines(meaning)]


def _indented_lines(meaning: str) -> list[str]:
    return textwrap.wrap(meaning, _WIDTH, initial_indent="      ", subsequent_indent="      ")


def _use_text(key: MachineKey) -> str:
    if key.at_root and key.nested:
        same = key.at_root == key.nested
        return key.at_root if same else f"{key.at_root} in a task, {key.nested} in a nested machine"
    return f"{key.at_root}, in a task only" if key.at_root else f"{key.nested}, in a nested machine only"


def _default_text(option: StateOption) -> str:
    if option.required:
        return "required"
    try:
        return f"default {literal(option.default)}" if option.default_known else "with a default"
    except GenerationError:
        return "with a default"


def _names(source: StateSource, key: str) -> str:
    names = source.default_names(key)
    if names is None:
        return "not known from the source"
    if key in source.options and key not in source.own_keys:
        return f"{', '.join(names) or 'none'} (by default)"
    return f"{', '.join(names) or 'none'}, and cannot be set"
