# SPDX-License-Identifier: BSD-3-Clause
"""Normalizes arguments of actions: texts, entities and typed values; public as `launch.utilities`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from launch.core.errors import LaunchError, line_of_launch_file
from launch.core.launch_context import LaunchContext
from launch.core.launch_description_entity import LaunchDescriptionEntity
from launch.core.some_entities_type import SomeEntitiesType
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.substitution import Substitution, TextSubstitution

TRUE_TEXTS, FALSE_TEXTS = ("true", "yes", "on", "1"), ("false", "no", "off", "0")


def normalize_to_list_of_substitutions(subs: SomeSubstitutionsType) -> list[Substitution]:
    """Returns the substitutions whose concatenated texts are the value.

    Raises:
        TypeError: A part is neither a text nor a substitution; the message contains the line of the launch file.
    """
    if isinstance(subs, str | Substitution) or not isinstance(subs, Iterable):
        subs = [subs]
    normalized: list[Substitution] = []
    for each in subs:
        if isinstance(each, Substitution):
            normalized.append(each)
        elif isinstance(each, str):
            normalized.append(TextSubstitution(text=each))
        else:
            raise TypeError(
                f"{line_of_launch_file()}: got {each!r} of type {type(each).__name__}; allowed: a text or a "
                f"substitution, for example '{each}'"
            )
    return normalized


def perform_substitutions(context: LaunchContext, subs: Iterable[Substitution]) -> str:
    """Returns the concatenated texts of substitutions."""
    return "".join(context.perform_substitution(each) for each in subs)


def perform_text(context: LaunchContext, value: SomeSubstitutionsType) -> str:
    """Returns the text of a value with substitutions."""
    return perform_substitutions(context, normalize_to_list_of_substitutions(value))


def perform_boolean(context: LaunchContext, value: bool | SomeSubstitutionsType, label: str) -> bool:
    """Returns the bool of a value with substitutions.

    Args:
        context: Launch context.
        value: A bool, or a text that is true or false.
        label: Name of the value for the message.

    Raises:
        LaunchError: The text is neither true nor false.
    """
    if isinstance(value, bool):
        return value
    text = perform_text(context, value).strip().lower()
    if text in TRUE_TEXTS:
        return True
    if text in FALSE_TEXTS:
        return False
    raise LaunchError(f"{label} is '{text}'; allowed: {', '.join((*TRUE_TEXTS, *FALSE_TEXTS))}; correct it")


def perform_number(context: LaunchContext, value: float | SomeSubstitutionsType, label: str) -> float:
    """Returns the number of a value with substitutions.

    Args:
        context: Launch context.
        value: A number, or a text with a number.
        label: Name of the value for the message.

    Raises:
        LaunchError: The text is not a number.
    """
    if isinstance(value, int | float):
        return float(value)
    text = perform_text(context, value)
    try:
        return float(text)
    except ValueError:
        raise LaunchError(f"{label} is '{text}'; allowed: a number; correct it") from None


def normalize_to_list_of_entities(entities: SomeEntitiesType | None) -> list[LaunchDescriptionEntity]:
    """Returns a list of one entity, several entities, or None.

    Raises:
        TypeError: An element is not an entity.
    """
    if entities is None:
        return []
    if isinstance(entities, LaunchDescriptionEntity):
        return [entities]
    found = list(entities)
    for each in found:
        if not isinstance(each, LaunchDescriptionEntity):
            raise TypeError(
                f"{line_of_launch_file()}: got {each!r} of type {type(each).__name__}; allowed: actions and launch "
                "descriptions"
            )
    return found


def is_a(obj: object, entity_type: type) -> bool:
    """Returns whether an object is an instance of a type."""
    return isinstance(obj, entity_type)


def is_a_subclass(obj: object, entity_type: type) -> bool:
    """Returns whether an object is an instance of a type, or a subclass."""
    return isinstance(obj, entity_type) or (isinstance(obj, type) and issubclass(obj, entity_type))


def ensure_argument_type(argument: Any, types: Any, argument_name: str, caller: str | None = None) -> None:
    """Checks the type of an argument.

    Args:
        argument: The argument.
        types: Allowed type or types.
        argument_name: Name of the argument for the message.
        caller: Name of the caller for the message.

    Raises:
        TypeError: The argument has none of the allowed types.
    """
    allowed = types if isinstance(types, type) else tuple(types)
    if not isinstance(argument, allowed):
        names = [each.__name__ for each in (allowed if isinstance(allowed, tuple) else (allowed,))]
        prefix = f"{caller}: " if caller else ""
        raise TypeError(
            f"{prefix}'{argument_name}' is {argument!r} of type {type(argument).__name__}; allowed: {', '.join(names)}"
        )
