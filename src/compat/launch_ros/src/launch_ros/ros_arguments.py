# SPDX-License-Identifier: BSD-3-Clause
"""Converts ROS arguments of ROS 2 (`--ros-args -r a:=b -p c:=d --`) to ROS 1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import yaml
from launch.core.errors import LaunchError, hint

REMAP, PARAMETER, FILE = ("-r", "--remap"), ("-p", "--param"), ("--params-file",)
IGNORED_WITH_VALUE = ("--log-level", "--log-config-file", "-e", "--enclave")
"""Options for logging and security, which ROS 1 configures differently."""
IGNORED = (
    "--enable-rosout-logs",
    "--disable-rosout-logs",
    "--enable-stdout-logs",
    "--disable-stdout-logs",
    "--enable-external-lib-logs",
    "--disable-external-lib-logs",
)


@dataclass
class RosArguments:
    """Parsed ROS arguments.

    Attributes:
        name: Name of the node; empty if not given.
        namespace: Namespace of the node; empty if not given.
        remappings: Pairs of old and new name.
        parameters: Dicts and paths of files.
    """

    name: str = ""
    namespace: str = ""
    remappings: list[tuple[str, str]] = field(default_factory=list)
    parameters: list[Any] = field(default_factory=list)


def split_ros_arguments(arguments: Sequence[str]) -> tuple[list[str], RosArguments]:
    """Returns the program's own arguments, and the parsed ROS arguments between `--ros-args` and `--`.

    Raises:
        LaunchError: A ROS argument is unknown.
    """
    own: list[str] = []
    found, inside = RosArguments(), False
    words = iter(arguments)
    for word in words:
        if word == "--ros-args":
            inside = True
        elif not inside:
            own.append(word)
        elif word == "--":
            inside = False
        elif word in IGNORED:
            continue
        elif word in (*REMAP, *PARAMETER, *FILE, *IGNORED_WITH_VALUE):
            _parse_argument(word, next(words, ""), found)
        else:
            allowed = (*REMAP, *PARAMETER, *FILE, *IGNORED_WITH_VALUE, *IGNORED)
            raise LaunchError(f"unknown ROS argument '{word}'{hint(word, allowed)}; allowed: {', '.join(allowed)}")
    return own, found


def _parse_argument(word: str, value: str, found: RosArguments) -> None:
    if word in IGNORED_WITH_VALUE:
        return
    if word in FILE:
        found.parameters.append(value)
        return
    name, separator, meaning = value.partition(":=")
    if not separator:
        raise LaunchError(f"got the ROS argument '{word} {value}'; allowed: {word} NAME:=VALUE")
    if word in PARAMETER:
        found.parameters.append({name: yaml.safe_load(meaning)})
    elif name == "__node" or name == "__name":
        found.name = meaning
    elif name == "__ns":
        found.namespace = meaning
    else:
        found.remappings.append((name, meaning))
