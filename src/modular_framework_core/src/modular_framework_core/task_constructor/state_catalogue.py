# SPDX-License-Identifier: BSD-3-Clause
"""Finds the available states and reads their options from the source, without running the source."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from modular_framework_core.state_api.constructor_keys import STATE_KEYS, keys_argument, own_keys
from modular_framework_core.state_api.option_annotations import from_annotation, from_hint, uses_in
from modular_framework_core.state_api.option_types import Anything, OptionType
from modular_framework_core.state_api.option_uses import Use
from modular_framework_core.task_constructor.state_classes import BASE_DEFAULTS, SourceClass, SourceModule
from modular_framework_core.task_constructor.state_classes import StateSourceError as StateSourceError
from modular_framework_core.task_constructor.state_imports import missing_imports
from modular_framework_core.task_constructor.userdata_reads import UserdataReads, reads_of

_NAMES = from_hint(Sequence[str])


@dataclass(frozen=True, slots=True)
class StateOption:
    """An option of a state: a keyword argument of its constructor.

    Attributes:
        name: Name of the argument and of the option in the task script.
        required: Whether the option has no default.
        default: Default written as a literal, else None.
        default_known: Whether ``default`` is the real default.
        type: Allowed values according to the annotation.
        uses: Names and userdata keys that the option refers to, according to the annotation.
    """

    name: str
    required: bool
    default: Any
    default_known: bool
    type: OptionType = Anything()
    uses: tuple[Use, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class StateSource:
    """A state class and its source file.

    Attributes:
        name: File name without ``.py``, the ``source`` of the state in a task.
        file: Absolute path.
        class_name: Name of the class.
        options: Constructor arguments by name.
        takes_any_option: Whether the constructor takes further keyword arguments or is unknown.
        is_framework_state: Whether the class derives from ``FrameworkState``, which needs at least two outcomes.
        doc: Docstring of the class.
        missing_imports: One message per import that Python cannot resolve.
        userdata: Userdata keys that the class reads.
        text: Source text, for checks that search for a word.
        own_keys: Outcomes and userdata keys that the constructor declares itself; None for unknown values.
    """

    name: str
    file: Path
    class_name: str
    options: dict[str, StateOption]
    takes_any_option: bool
    is_framework_state: bool
    doc: str
    missing_imports: tuple[str, ...] = ()
    userdata: UserdataReads = UserdataReads()
    text: str = field(default="", repr=False)
    own_keys: dict[str, tuple[str, ...] | None] = field(default_factory=dict)

    def default_names(self, key: str) -> tuple[str, ...] | None:
        """Returns the default of ``outcomes`` or of a list of userdata keys; None if unknown."""
        if key in self.own_keys:
            return self.own_keys[key]
        option = self.options.get(key)
        if option is None:
            return None if self.takes_any_option else ()
        if not option.default_known:
            return None
        if isinstance(option.default, (list, tuple)) and all(isinstance(name, str) for name in option.default):
            return tuple(option.default)
        return () if option.default is None else None


def class_name_of(source_name: str) -> str:
    """Returns the class name for a file name: ``wait_for_signal`` -> ``WaitForSignal``."""
    return "".join(word.capitalize() for word in source_name.split("_"))


class StateCatalogue:
    """The states in one or more directories. If a name occurs twice, the first directory takes precedence."""

    def __init__(self, directories: Iterable[Path]) -> None:
        """Lists the directories.

        Args:
            directories: Directories in search order.

        Raises:
            FileNotFoundError: A directory does not exist.
        """
        self.empty_directories: list[Path] = []
        """Directories without states."""
        self._files: dict[str, Path] = {}
        self._read: dict[str, StateSource | StateSourceError] = {}
        for directory in directories:
            if not directory.is_dir():
                raise FileNotFoundError(f"states directory {directory} is not a directory")
            files = [file for file in sorted(directory.glob("*.py")) if not file.stem.startswith("_")]
            if not files:
                self.empty_directories.append(directory)
            for file in files:
                self._files.setdefault(file.stem, file.resolve())

    def names(self) -> list[str]:
        """Returns the names of all states, sorted."""
        return sorted(self._files)

    def resolve(self, name: str) -> str | None:
        """Returns a state's name without the optional prefix ``state_``, or None if the state is unknown."""
        if name in self._files:
            return name
        base_name = name.removeprefix("state_")
        return base_name if base_name in self._files else None

    def get(self, name: str) -> StateSource:
        """Returns a state, which is read on first use.

        Args:
            name: Name from ``names()``.

        Raises:
            StateSourceError: The file does not define a usable state class.
        """
        if name not in self._read:
            try:
                self._read[name] = _read_state(name, self._files[name])
            except StateSourceError as error:
                self._read[name] = error
        result = self._read[name]
        if isinstance(result, StateSourceError):
            raise result
        return result


def _read_state(name: str, file: Path) -> StateSource:
    module = SourceModule(file)
    class_name = class_name_of(name)
    if class_name not in module.classes:
        raise StateSourceError(
            f"{file} must define the class {class_name} (the file name in camel case); it defines: "
            f"{', '.join(module.classes) or 'no class'}"
        )
    state = SourceClass(module.classes[class_name], module)
    options, takes_any = _constructor_options(state)
    is_framework_state = state.is_framework_state
    if (
        is_framework_state
        and "io_keys" in options
        and options["io_keys"].default_known
        and options["io_keys"].default is None
    ):
        options["io_keys"] = _default_io_keys(state)
    return StateSource(
        name=name,
        file=file,
        class_name=class_name,
        options=options,
        takes_any_option=takes_any,
        is_framework_state=is_framework_state,
        doc=state.doc,
        missing_imports=missing_imports(module.tree, file),
        userdata=reads_of(state.node),
        text=file.read_text(encoding="utf-8"),
        own_keys=_own_keys(state),
    )


def _constructor_options(state: SourceClass) -> tuple[dict[str, StateOption], bool]:
    """Returns the options of a class's own or inherited constructor, and whether it takes further options."""
    if state.constructor is None:
        return _base_options(state)
    options, takes_any = _arguments(state.constructor.args, state.module.aliases)
    if not keys_argument(state.constructor):
        return options, takes_any
    inherited, takes_any = _base_options(state)
    return options | {key: inherited[key] for key in STATE_KEYS if key in inherited}, takes_any


def _base_options(state: SourceClass) -> tuple[dict[str, StateOption], bool]:
    """Returns the options of the base class's constructor, and whether it takes further options."""
    for name in state.base_names:
        base = state.base(name)
        if base is not None:
            return _constructor_options(base)
        if name in BASE_DEFAULTS:
            defaults = {"outcomes": BASE_DEFAULTS[name], "io_keys": None}
            return {key: StateOption(key, False, defaults.get(key, ()), True, _NAMES) for key in STATE_KEYS}, False
    return {}, True


def _default_io_keys(state: SourceClass) -> StateOption:
    """Returns the option ``io_keys`` with the class's own or inherited ``DEFAULT_IO_KEYS`` as the default."""
    for item in state.node.body:
        match item:
            case ast.Assign(targets=[ast.Name("DEFAULT_IO_KEYS")], value=value):
                return replace(_option(ast.arg("io_keys"), value, state.module.aliases), type=_NAMES)
    return _default_io_keys(state.bases[0]) if state.bases else StateOption("io_keys", False, (), True, _NAMES)


def _own_keys(state: SourceClass) -> dict[str, tuple[str, ...] | None]:
    """Returns the outcomes and userdata keys that a class's own or inherited constructor declares."""
    if state.constructor is None:
        return _own_keys(state.bases[0]) if state.bases else {}
    has_smach_base = bool(state.base_names) and state.base_names[0] in BASE_DEFAULTS
    return own_keys(state.constructor, has_smach_base, state.module.aliases)


def _arguments(arguments: ast.arguments, aliases: dict[str, ast.expr]) -> tuple[dict[str, StateOption], bool]:
    positional = [*arguments.posonlyargs, *arguments.args]
    padding: list[ast.expr | None] = [None] * (len(positional) - len(arguments.defaults))
    pairs = list(zip(positional, [*padding, *arguments.defaults], strict=True))[1:]
    pairs += list(zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True))
    options = {argument.arg: _option(argument, default, aliases) for argument, default in pairs}
    return options, arguments.kwarg is not None


def _option(argument: ast.arg, default: ast.expr | None, aliases: dict[str, ast.expr]) -> StateOption:
    name, kind = argument.arg, from_annotation(argument.annotation, aliases)
    uses = uses_in(argument.annotation, aliases)
    if default is None:
        return StateOption(name, True, None, False, kind, uses)
    try:
        return StateOption(name, False, ast.literal_eval(default), True, kind, uses)
    except (ValueError, TypeError, SyntaxError):
        return StateOption(name, False, None, False, kind, uses)
