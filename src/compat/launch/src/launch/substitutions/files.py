# SPDX-License-Identifier: BSD-3-Clause
"""Substitutions that read files or run programs."""

from __future__ import annotations

import importlib
import os
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any

from launch.core.errors import SubstitutionFailure, hint
from launch.core.launch_context import LaunchContext
from launch.core.screen_log import get_logger
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.substitution import Substitution
from launch.core.utilities import normalize_to_list_of_substitutions, perform_substitutions, perform_text
from launch.substitutions.text import SubstitutionOfText, described

ON_STDERR = ("fail", "ignore", "warn", "capture")


class PathJoinSubstitution(Substitution):
    """Path of parts that are joined with slashes.

    Args:
        substitutions: Parts of the path; a part may be a sequence, which is concatenated.
    """

    def __init__(self, substitutions: Any) -> None:
        parts = [substitutions] if isinstance(substitutions, str | Substitution) else list(substitutions)
        self._parts = [normalize_to_list_of_substitutions(part) for part in parts]

    @property
    def substitutions(self) -> list[Substitution]:
        """Returns the parts of the path."""
        return [each for part in self._parts for each in part]

    def describe(self) -> str:
        return f"PathJoin({', '.join(described(part) for part in self._parts)})"

    def perform(self, context: LaunchContext) -> str:
        return os.path.join(*(perform_substitutions(context, part) for part in self._parts))

    def __truediv__(self, part: SomeSubstitutionsType) -> PathJoinSubstitution:
        """Returns the path with an additional part, as in `path / "config"`."""
        return PathJoinSubstitution([*self._parts, normalize_to_list_of_substitutions(part)])


class FileContent(SubstitutionOfText):
    """Content of a text file.

    Args:
        path: Path of the file.
    """

    def __init__(self, path: SomeSubstitutionsType) -> None:
        super().__init__(path)

    def _value(self, context: LaunchContext, text: str) -> str:
        path = Path(text)
        try:
            return path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            beside = [str(each) for each in path.parent.iterdir()] if path.parent.is_dir() else []
            raise SubstitutionFailure(f"FileContent: {path} cannot be read: {error}{hint(str(path), beside)}") from None


class FindExecutable(SubstitutionOfText):
    """Path of a program.

    Args:
        name: Name of the program in PATH.
    """

    label = "FindExec"

    def __init__(self, name: SomeSubstitutionsType) -> None:
        super().__init__(name)

    def _value(self, context: LaunchContext, name: str) -> str:
        path = context.environment.get("PATH", os.defpath)
        found = shutil.which(name, path=path)
        if found is None:
            raise SubstitutionFailure(
                f"program '{name}' is not found; searched the folders in PATH: {path}; install it, or source the "
                "workspace that contains it"
            )
        return found


class Command(SubstitutionOfText):
    """Output of a program.

    Args:
        command: Program and arguments, split as in a shell.
        on_stderr: Handling of error output: fail, ignore, warn, or capture (add to the output).
    """

    command = SubstitutionOfText.text

    def __init__(self, command: SomeSubstitutionsType, *, on_stderr: SomeSubstitutionsType = "fail") -> None:
        super().__init__(command)
        self._on_stderr = normalize_to_list_of_substitutions(on_stderr)

    def _value(self, context: LaunchContext, command: str) -> str:
        on_stderr = perform_substitutions(context, self._on_stderr)
        if on_stderr not in ON_STDERR:
            raise SubstitutionFailure(
                f"Command: on_stderr is '{on_stderr}'; allowed: {', '.join(ON_STDERR)}{hint(on_stderr, ON_STDERR)}"
            )
        try:
            result = subprocess.run(
                shlex.split(command),
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT if on_stderr == "capture" else subprocess.PIPE,
                text=True,
                check=False,
            )
        except (OSError, ValueError) as error:
            raise SubstitutionFailure(f"Command: '{command}' cannot be run: {error}") from None
        if result.returncode != 0:
            raise SubstitutionFailure(
                f"Command: '{command}' ended with exit code {result.returncode}: "
                f"{(result.stderr or result.stdout).strip()}"
            )
        if result.stderr and on_stderr == "fail":
            raise SubstitutionFailure(
                f"Command: '{command}' printed errors: {result.stderr.strip()}; correct them, or give Command "
                "on_stderr='warn'"
            )
        if result.stderr and on_stderr == "warn":
            get_logger().warning("Command: '%s' printed errors: %s", command, result.stderr.strip())
        return result.stdout


class PythonExpression(SubstitutionOfText):
    """Value of a Python expression, as a string.

    Args:
        expression: The expression; strings from substitutions need quotes.
        python_modules: Modules for the expression; names of `math` need no prefix.
    """

    label = "PythonExpr"
    expression = SubstitutionOfText.text

    def __init__(self, expression: SomeSubstitutionsType, python_modules: SomeSubstitutionsType = ("math",)) -> None:
        super().__init__(expression)
        self._modules = normalize_to_list_of_substitutions(python_modules)

    def _value(self, context: LaunchContext, expression: str) -> str:
        names: dict[str, Any] = {}
        try:
            for substitution in self._modules:
                module = importlib.import_module(perform_text(context, substitution))
                names |= vars(module) if module.__name__ == "math" else {}
                names[module.__name__] = module
            return str(eval(expression, {}, names))  # noqa: S307  # the launch file is a program of the user's
        except Exception as error:  # an expression may raise anything
            raise SubstitutionFailure(
                f"PythonExpression: {expression!r}: {type(error).__name__}: {error}; add quotes around texts"
            ) from error
