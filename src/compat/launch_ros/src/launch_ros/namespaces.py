# SPDX-License-Identifier: BSD-3-Clause
"""Names of nodes and namespaces."""

from __future__ import annotations

import re

from launch.core.errors import LaunchError

_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")


def join(base: str | None, name: str | None) -> str:
    """Returns the absolute namespace of a name.

    Args:
        base: Enclosing namespace; None for the root namespace.
        name: Namespace, absolute or relative to the base; None for the base itself.

    Raises:
        LaunchError: A part is not a valid ROS name.
    """
    joined = name if name and name.startswith("/") else f"{base or ''}/{name or ''}"
    parts = [part for part in joined.split("/") if part]
    for part in parts:
        _check(part, "namespace", joined)
    return "/" + "/".join(parts)


def check_node_name(name: str) -> str:
    """Checks and returns the name of a node.

    Raises:
        LaunchError: The name is not a valid ROS name, or contains a namespace.
    """
    _check(name, "node name", name)
    return name


def full_name(namespace: str, name: str) -> str:
    """Returns the full name of a name in an absolute namespace."""
    return f"{namespace.rstrip('/')}/{name}"


def name_from(executable: str) -> str:
    """Returns a node name derived from the name of a program."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", executable.removesuffix(".py"))
    return name if _WORD.match(name) else f"node_{name}"


def _check(part: str, noun: str, full_name: str) -> None:
    if not _WORD.match(part):
        raise LaunchError(
            f"{noun} '{full_name}' is invalid; allowed: letters, digits and underscores, starting with a letter"
            f"{'; give the namespace as namespace=...' if noun == 'node name' and '/' in full_name else ''}"
        )
