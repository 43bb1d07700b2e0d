# SPDX-License-Identifier: BSD-3-Clause
"""Tells what a state does and takes, out of its signature and docstring."""
from __future__ import annotations

import inspect
import re
import textwrap

from modular_framework_core.task_constructor.generator import GenerationError, literal
from modular_framework_core.task_constructor.state_catalogue import STATE_KEYS, StateOption, StateSource

_WIDTH = 110
_SECTION = re.compile(r"^(Args|Arguments|Raises|Returns|Attributes|Example|Examples):\s*$", re.MULTILINE)
_ENTRY = re.compile(r"^(\w+)(?: \([^)]*\))?:\s*(.*)$")


def explain(source: StateSource) -> str:
    """Return a page about a state: what it does, its options with types and defaults, its outcomes and userdata."""
    doc = inspect.cleandoc(source.doc)
    section = _SECTION.search(doc)
    summary = (doc[:section.start()] if section else doc).strip() or "(its class has no docstring)"
    meanings = option_meanings(doc)
    lines = [f"{source.name}: {source.class_name}, {source.file}", "", summary, "", "Options:"]
    for option in source.options.values():
        if option.name not in STATE_KEYS:
            lines += _option(option, meanings.get(option.name, ""))
    if source.takes_any_option:
        lines.append("  and any other option: its constructor takes further keyword arguments")
    lines += ["", f"Outcomes: {_names(source, 'outcomes')}"]
    lines += [f"{key.replace('_', ' ').capitalize()}: {_names(source, key)}" for key in STATE_KEYS[1:]]
    return "\n".join(lines)


def option_meanings(doc: str) -> dict[str, str]:
    """Return what the section ``Args`` of a docstring says about each option, on one line each."""
    parts = _SECTION.split(inspect.cleandoc(doc))
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    meanings: dict[str, str] = {}
    name = ""
    for line in textwrap.dedent(sections.get("Args", sections.get("Arguments", ""))).splitlines():
        entry = _ENTRY.match(line)
        if entry:
            name, meanings[entry[1]] = entry[1], entry[2].strip()
        elif name and line.startswith(" "):
            meanings[name] = f"{meanings[name]} {line.strip()}"
    return meanings


def _option(option: StateOption, meaning: str) -> list[str]:
    text = f"  {option.name}: {option.type.describe()}, {_default(option)}"
    return [text, *textwrap.wrap(meaning, _WIDTH, initial_indent="      ", subsequent_indent="      ")]


def _default(option: StateOption) -> str:
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
    return f"{', '.join(names) or 'none'} (by default)" if key in source.options else "none, and cannot be set"
