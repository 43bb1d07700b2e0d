# SPDX-License-Identifier: BSD-3-Clause
"""Saves the messages of a manager to a YAML file and loads them without loss of precision.

A saved file is JSON, a subset of YAML, with one line per message. JSON parses hundreds of times as fast as YAML; files
edited by hand may use all of YAML.
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
    """A message file cannot be written or read."""


def path_of(text: str, folder: Path, other_folders: Iterable[Path] = ()) -> Path:
    """Returns the file path given in a request.

    Args:
        text: Requested path; a relative path starts at ``folder``.
        folder: Folder of the managers' files.
        other_folders: Further allowed folders.

    Raises:
        MessageFileError: The path is empty, does not end in .yaml, or is outside of the allowed folders.
    """
    try:
        path = folder / Path(text).expanduser()
        inside = any(path.resolve().is_relative_to(allowed.resolve()) for allowed in (folder, *other_folders))
    except (OSError, RuntimeError, ValueError) as error:  # NUL byte, unknown user, cycle of links
        raise MessageFileError(f"path {text!r} is not a valid path: {error}; name a file in {folder}") from error
    if not text or path.suffix not in SUFFIXES:
        raise MessageFileError(f"path {text!r}: give a file that ends in {' or '.join(SUFFIXES)}, in {folder}")
    if not inside:
        raise MessageFileError(
            f"path {text!r} is outside of the managers' folder {folder}; name a file in this folder, or "
            "change the folder (parameter ~file_directory of the managers)"
        )
    return path


def save(path: Path, kind: str, named: Mapping[str, Any], anonymous: Iterable[Any]) -> int:
    """Writes messages to a file atomically.

    Args:
        path: Output file; the folder is created if missing.
        kind: Kind of the messages, stored in the file.
        named: Messages by name.
        anonymous: Anonymous messages, oldest first.

    Returns:
        The number of written messages.

    Raises:
        MessageFileError: The file cannot be written.
    """
    named_lines = [f" {json.dumps(name)}: {flow_text(message)}" for name, message in named.items()]
    anonymous_lines = [f" {flow_text(message)}" for message in anonymous]
    text = "\n".join(
        [
            f'{{"kind": {json.dumps(kind)},',
            '"named": {',
            ",\n".join(named_lines),
            "},",
            '"anonymous": [',
            ",\n".join(anonymous_lines),
            "]}",
            "",
        ]
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text, mode=0o600)
    except OSError as error:
        raise MessageFileError(f"{path} cannot be written: {error}") from error
    return len(named_lines) + len(anonymous_lines)


def load(path: Path, kind: str, message_type: Any) -> tuple[dict[str, Any], list[Any]]:
    """Reads the messages in a saved file.

    Args:
        path: Message file.
        kind: Expected kind of the messages.
        message_type: Class of the messages.

    Returns:
        The messages by name, and the anonymous messages, oldest first.

    Raises:
        MessageFileError: The file cannot be read, contains a different kind of message, or contains messages that do
            not match the type. The message names all of them.
    """
    try:
        content = parse_text(read_text(path))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        raise MessageFileError(f"{path} cannot be read: {error}") from error
    if not isinstance(content, dict) or content.get("kind") != kind:
        file_kind = content.get("kind") if isinstance(content, dict) else None
        raise MessageFileError(
            f"{path} contains messages of the kind '{file_kind}'; give a saved file of the kind '{kind}'"
        )
    mapping, items = content.get("named") or {}, content.get("anonymous") or []
    if not isinstance(mapping, dict) or not isinstance(items, list):
        raise MessageFileError(f"{path}: 'named' must be a mapping of names to messages and 'anonymous' a list")
    faults = [f"{path}: {fault}" for name in mapping if (fault := name_fault(str(name)))]
    named = {
        str(name): _fill_message(message_type, value, f"{path}: '{name}'", faults) for name, value in mapping.items()
    }
    anonymous = [
        _fill_message(message_type, value, f"{path}: anonymous message {index}", faults)
        for index, value in enumerate(items, start=1)
    ]
    if faults:
        raise MessageFileError("\n".join(faults))
    return named, anonymous


class _YamlLoader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """YAML loader that also reads JSON's numbers: YAML 1.1 reads 1e-07, NaN and Infinity as text."""


_YamlLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?(\d+[eE][-+]?\d+|NaN|Infinity)$"), [*"-+0123456789NI"]
)


def parse_text(text: str) -> Any:
    """Returns the content of a JSON or YAML text."""
    for parse in (orjson.loads, json.loads):  # only the slower json reads NaN and Infinity
        try:
            return parse(text)
        except json.JSONDecodeError:
            continue
        except RecursionError:
            break
    return shallow_yaml.load(text, _YamlLoader)


def flow_text(message: Any) -> str:
    """Returns a message as one line of JSON."""
    text = orjson.dumps(message, default=_plain_value).decode()
    if "null" in text:  # orjson writes null for non-finite numbers; the slower json writes their names
        return json.dumps(message, default=_plain_value)
    return text


def _plain_value(value: Any) -> Any:
    """Converts a value that JSON does not support."""
    match value:
        case genpy.Message():
            return {name: getattr(value, name) for name in value.__slots__}
        case genpy.TVal():
            return {"secs": value.secs, "nsecs": value.nsecs}
        case bytes():
            return list(value)
        case _:
            return value.tolist()  # NumPy's numbers and arrays


def _fill_message(message_type: Any, value: Any, where: str, faults: list[str]) -> Any:
    message = message_type()
    try:
        try:
            message = _build_value(message_type, value)
        except (LookupError, TypeError):  # messages written by hand may omit fields
            genpy.message.fill_message_args(message, [value])
        message.serialize(io.BytesIO())
    except (genpy.MessageException, ValueError, TypeError, AttributeError) as error:
        faults.append(f"{where} is not a valid {message_type._type}: {error}")
    return message


def _build_value(message_type: Any, value: Any) -> Any:
    """Returns a message read from the output of ``save``, ten times as fast as genpy.

    Raises:
        LookupError, TypeError: The value is not a mapping with all fields.
    """
    fields = fields_of(message_type)
    if type(value) is not dict or len(value) != len(fields):
        raise TypeError(f"not a mapping with all fields of {message_type}")
    message = message_type.__new__(message_type)
    for name, part, is_list in fields:
        content = value[name]
        if is_list and type(content) is not list:
            raise TypeError(f"{name} is not a list")
        if part is not None:
            content = [_build_value(part, item) for item in content] if is_list else _build_value(part, content)
        setattr(message, name, content)
    return message


@cache
def fields_of(message_type: Any) -> tuple[tuple[str, Any, bool], ...]:
    """Returns (name, message class or None, whether the field is a list) of each field."""
    if issubclass(message_type, genpy.TVal):
        return ("secs", None, False), ("nsecs", None, False)
    fields = []
    for name, slot_type in zip(message_type.__slots__, message_type._slot_types, strict=True):
        base_type, is_list, _length = genmsg.msgs.parse_type(slot_type)
        primitive = base_type in genmsg.msgs.PRIMITIVE_TYPES
        part = None if primitive else genpy.message.get_message_class(base_type)
        fields.append((name, part, is_list))
    return tuple(fields)
