# SPDX-License-Identifier: BSD-3-Clause
"""Finds the templates of state machines and the header keys that each template uses."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

SUFFIX = ".template"
_OPTION = re.compile(r"\boptions\.(\w+)|\boptions\[['\"](\w+)['\"]\]")
_TAKES_KEYS = re.compile(r"\bchildren\.keys\b|\binput_keys\b")
_DOC = re.compile(r'^class\b.*:\s*\n\s*"""(.*?)"""', re.MULTILINE | re.DOTALL)
_RENAMED = {
    "states_source": "nothing: the imports of states are written above all classes",
    "components": "state_machine.states, which children.add writes",
    "parameters": "fields of state_machine (outcomes, default_outcome, outcome_map, shares_userdata), and "
    "options.<key>",
}
"""Attributes of ``state_machine`` in templates of the original framework, and their replacements."""
_OLD_NAME = re.compile(rf"\bstate_machine\.({'|'.join(_RENAMED)})\b")
_PROVIDES = re.compile(r"\{#\s*userdata:\s*([\w\s,]*?)\s*#\}")


@dataclass(frozen=True, slots=True, kw_only=True)
class TemplateSource:
    """A template file.

    Attributes:
        name: File name without ``.template``, the ``source`` of a machine in a task.
        file: Absolute path.
        concurrent: Whether the template generates a ``smach.Concurrence``.
        options: Header keys that only this template uses, as ``options.<key>``.
        takes_keys: Whether machines may have ``input_keys`` and ``output_keys``.
        userdata: Userdata keys that the machine provides, as declared by a comment ``{# userdata: a, b #}``; None
            without a declaration.
        doc: Docstring of the generated class.
        fault: Reason why the template is unusable; "" if valid.
    """

    name: str
    file: Path
    concurrent: bool
    options: frozenset[str]
    takes_keys: bool
    userdata: frozenset[str] | None
    doc: str
    fault: str = ""


class TemplateCatalogue:
    """The templates in one or more directories. If a name occurs twice, the first directory takes precedence."""

    def __init__(self, directories: Iterable[Path]) -> None:
        """Lists and reads the templates.

        Raises:
            FileNotFoundError: A directory does not exist.
        """
        self.directories = tuple(directories)
        self._templates: dict[str, TemplateSource] = {}
        for directory in self.directories:
            if not directory.is_dir():
                raise FileNotFoundError(f"templates directory {directory} is not a directory")
            for file in sorted(directory.glob(f"*{SUFFIX}")):
                name = file.name.removesuffix(SUFFIX)
                if name not in self._templates:
                    self._templates[name] = _read_template(name, file.resolve())

    def names(self) -> list[str]:
        """Returns the names of all templates, sorted."""
        return sorted(self._templates)

    def get(self, name: str) -> TemplateSource | None:
        """Returns the template of a name, or None if unknown."""
        return self._templates.get(name)


def _read_template(name: str, file: Path) -> TemplateSource:
    text = file.read_text(encoding="utf-8")
    options = frozenset(first or second for first, second in _OPTION.findall(text))
    declared = _PROVIDES.search(text)
    provided = None if declared is None else frozenset(re.findall(r"\w+", declared.group(1)))
    concurrent, takes_keys = re.search(r"\bConcurrence\b", text), _TAKES_KEYS.search(text)
    doc = _DOC.search(text)
    return TemplateSource(
        name=name,
        file=file,
        concurrent=concurrent is not None,
        options=options,
        takes_keys=takes_keys is not None,
        userdata=provided,
        doc="" if doc is None else inspect.cleandoc(doc.group(1)),
        fault=_original_names(text, file),
    )


def _original_names(text: str, file: Path) -> str:
    """Returns the original framework's names in a template and their replacements as a fault; "" without such names."""
    first_lines: dict[str, int] = {}
    for line_number, line in enumerate(text.splitlines(), start=1):
        for name in _OLD_NAME.findall(line):
            first_lines.setdefault(name, line_number)
    if not first_lines:
        return ""
    renamed = "; ".join(
        f"{file}:{line}: state_machine.{name} is now {_RENAMED[name]}" for name, line in first_lines.items()
    )
    return (
        f"it is written for the original framework: {renamed}; 'Templates' in modular_framework_core's README shows one"
    )
