# SPDX-License-Identifier: BSD-3-Clause
"""Writes the messages of a manager to a YAML file and reads them back, every number to the last bit.

A saved file is JSON, which is YAML too, one line a message: a parser of JSON reads a plan hundreds of times as fast as
one of YAML, which is kept for files that were written or changed by hand.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import genmsg.msgs
import genpy
import genpy.message
import orjson
import yaml

from modular_framework_core.files import shallow_yaml
from modular_framework_core.files.atomic_files import read_text, write_atomically
from modular_framework_core.files.yaml_entries import name_fault

SUFFIXES = (".yaml", ".yml")


class MessageFileError(ValueError):
    """A file cannot be written, or is no file of a manager's messages; the text says why."""


def path_of(text: str, folder: Path, others: Iterable[Path] = ()) -> Path:
    """Returns the path a request names.

    Args:
        text: What was asked for; a relative path starts at ``folder``.
        folder: Where the managers keep files.
        others: Further folders it may be in.

    Raises:
        MessageFileError: No path was given, it does not end in .yaml, or it is in none of the folders.
    """
    try:
        path = folder / Path(text).expanduser()
        inside = any(path.resolve().is_relative_to(allowed.resolve()) for allowed in (folder, *others))
    except (OSError, RuntimeError, ValueError) as error:  # of a name with a NUL byte, an unknown user, links in a ring
        raise MessageFileError(f"path {text!r} is not a valid path: {error}; name a file in {folder}") from error
    if not text or path.suffix not in SUFFIXES:
        raise MessageFileError(f"path {text!r}: a file that ends in {' or '.join(SUFFIXES)} is needed, in {folder}")
    if not inside:
        raise MessageFileError(
            f"path {text!r} is outside of the managers' folder {folder}; name a file in it, or "
            "start the managers with another one (parameter ~file_directory)"
        )
    return path


def save(path: Path, kind: str, named: Mapping[str, Any], anonymous: Iterable[Any]) -> int:
    """Writes messages to a file atomically.

    Args:
        path: File to write; its folder is made when it is not there.
        kind: Kind of the messages, for whoever reads the file.
        named: Messages by name.
        anonymous: Messages without a name, oldest first.

    Returns:
        How many messages were written.

    Raises:
        MessageFileError: The file cannot be written.
    """
    by_name = [f" {json.dumps(name)}: {flow_text(message)}" for name, message in named.items()]
    waiting = [f" {flow_text(message)}" for message in anonymous]
    text = "\n".join(
        [
            f'{{"kind": {json.dumps(kind)},',
            '"named": {',
            ",\n".join(by_name),
            "},",
            '"anonymous": [',
            ",\n".join(waiting),
            "]}",
            "",
        ]
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text, mode=0o600)
    except OSError as error:
        raise MessageFileError(f"{path} cannot be written: {error}") from error
    return len(by_name) + len(waiting)


def load(path: Path, kind: str, message_type: Any) -> tuple[dict[str, Any], list[Any]]:
    """Reads what ``save`` wrote.

    Args:
        path: File to read.
        kind: Kind of messages that is expected.
        message_type: Class of the messages.

    Returns:
        The messages by name, and those without one, oldest first.

    Raises:
        MessageFileError: The file cannot be read, has another kind of message, or a message does not fit its type;
            every message that does not is named.
    """
    try:
        content = parsed(read_text(path))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        raise MessageFileError(f"{path} cannot be read: {error}") from error
    if not isinstance(content, dict) or content.get("kind") != kind:
        found = content.get("kind") if isinstance(content, dict) else None
        raise MessageFileError(
            f"{path} holds messages of the kind '{found}'; a saved file of the kind '{kind}' is needed"
        )
    given, waiting = content.get("named") or {}, content.get("anonymous") or []
    if not isinstance(given, dict) or not isinstance(waiting, list):
        raise MessageFileError(f"{path}: 'named' must be a mapping of names to messages and 'anonymous' a list")
    faults = [f"{path}: {fault}" for name in given if (fault := name_fault(str(name)))]
    named = {str(name): _filled(message_type, value, f"{path}: '{name}'", faults) for name, value in given.items()}
    anonymous = [
        _filled(message_type, value, f"{path}: anonymous message {number}", faults)
        for number, value in enumerate(waiting, start=1)
    ]
    if faults:
        raise MessageFileError("\n".join(faults))
    return named, anonymous


class _YamlLoader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Reads numbers as JSON has them, too: YAML 1.1 reads 1e-07, NaN and Infinity as text."""


_YamlLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?(\d+[eE][-+]?\d+|NaN|Infinity)$"), [*"-+0123456789NI"]
)


def parsed(text: str) -> Any:
    """Returns the data of a text in JSON or YAML."""
    for parse in (orjson.loads, json.loads):  # only the slower one reads NaN and Infinity
        try:
            return parse(text)
        except json.JSONDecodeError:
            continue
        except RecursionError:
            break
    return shallow_yaml.load(text, _YamlLoader)


def flow_text(message: Any) -> str:
    """Writes a message as one line of JSON."""
    text = orjson.dumps(message, default=_plain).decode()
    if "null" in text:  # written for numbers that are not finite, which only the slower writer can write
        return json.dumps(message, default=_plain)
    return text


def _plain(value: Any) -> Any:
    """Converts what a JSON writer cannot write."""
    match value:
        case genpy.Message():
            return {name: getattr(value, name) for name in value.__slots__}
        case genpy.TVal():
            return {"secs": value.secs, "nsecs": value.nsecs}
        case bytes():
            return list(value)
        case _:
            return value.tolist()  # NumPy's numbers and arrays


def _filled(message_type: Any, value: Any, where: str, faults: list[str]) -> Any:
    message = message_type()
    try:
        try:
            message = _built(message_type, value)
        except (LookupError, TypeError):  # by hand a message may be written in other ways, too
            genpy.message.fill_message_args(message, [value])
        message.serialize(io.BytesIO())
    except (genpy.MessageException, ValueError, TypeError, AttributeError) as error:
        faults.append(f"{where} is no {message_type._type}: {error}")
    return message


def _built(message_type: Any, value: Any) -> Any:
    """Makes a message of the output of ``save``, ten times as fast as genpy does.

    Raises:
        LookupError, TypeError: The value is not the mapping of all fields that ``save`` writes.
    """
    fields = fields_of(message_type)
    if type(value) is not dict or len(value) != len(fields):
        raise TypeError(f"no mapping of all fields of {message_type}")
    message = message_type.__new__(message_type)
    for name, part, is_list in fields:
        content = value[name]
        if is_list and type(content) is not list:
            raise TypeError(f"{name} is no list")
        if part is not None:
            content = [_built(part, item) for item in content] if is_list else _built(part, content)
        setattr(message, name, content)
    return message


@cache
def fields_of(message_type: Any) -> tuple[tuple[str, Any, bool], ...]:
    """Returns name, class where it is a message or several, and whether it is a list, of each field."""
    if issubclass(message_type, genpy.TVal):
        return ("secs", None, False), ("nsecs", None, False)
    fields = []
    for name, slot_type in zip(message_type.__slots__, message_type._slot_types, strict=True):
        base_type, is_list, _length = genmsg.msgs.parse_type(slot_type)
        primitive = base_type in genmsg.msgs.PRIMITIVE_TYPES
        part = None if primitive else genpy.message.get_message_class(base_type)
        fields.append((name, part, is_list))
    return tuple(fields)
