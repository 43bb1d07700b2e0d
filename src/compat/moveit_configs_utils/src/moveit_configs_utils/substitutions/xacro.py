# SPDX-License-Identifier: BSD-3-Clause
"""Expands a xacro file during the launch, with arguments that may be substitutions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from launch import LaunchContext, SomeSubstitutionsType, Substitution
from launch.utilities import normalize_to_list_of_substitutions, perform_substitutions
from launch_param_builder import load_xacro


class Xacro(Substitution):
    """XML of an expanded xacro file; path, names and values of its arguments may be substitutions."""

    def __init__(
        self,
        file_path: SomeSubstitutionsType,
        *,
        mappings: Mapping[SomeSubstitutionsType, SomeSubstitutionsType] | None = None,
    ) -> None:
        """Stores the file and its arguments.

        Args:
            file_path: Path of the xacro file.
            mappings: Values of its arguments, by name.
        """
        super().__init__()
        self._file_path = normalize_to_list_of_substitutions(file_path)
        self._mappings = dict(mappings or {})

    @property
    def file_path(self) -> list[Substitution]:
        """Returns the path of the file, as substitutions."""
        return self._file_path

    @property
    def mappings(self) -> dict[SomeSubstitutionsType, SomeSubstitutionsType]:
        """Returns the values of the arguments."""
        return self._mappings

    def describe(self) -> str:
        """Returns a description for messages."""
        arguments = ", ".join(f"{_description(name)}:={_description(value)}" for name, value in self._mappings.items())
        return f"Xacro(file_path = {_description(self._file_path)}, mappings = {arguments})"

    def perform(self, context: LaunchContext) -> str:
        """Returns the XML; raises the exceptions of launch_param_builder.load_xacro."""
        mappings = {_text(context, name): _text(context, value) for name, value in self._mappings.items()}
        return load_xacro(Path(perform_substitutions(context, self._file_path)), mappings)


def _text(context: LaunchContext, value: SomeSubstitutionsType) -> str:
    return perform_substitutions(context, normalize_to_list_of_substitutions(value))


def _description(value: SomeSubstitutionsType) -> str:
    return " + ".join(part.describe() for part in normalize_to_list_of_substitutions(value))
