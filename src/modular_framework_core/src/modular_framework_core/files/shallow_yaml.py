# SPDX-License-Identifier: BSD-3-Clause
"""Reads untrusted YAML. Excessive nesting is refused before it costs stack or time."""

from __future__ import annotations

from typing import Any

import yaml

MAX_DEPTH = 100
"""Maximum nesting depth of lists and mappings."""


class TooDeepError(yaml.YAMLError):
    """A YAML text is nested too deeply."""


def check_depth(text: str) -> None:
    """Checks the nesting depth of a YAML text.

    Raises:
        TooDeepError: The depth exceeds ``MAX_DEPTH``.
        yaml.YAMLError: The text is not valid YAML.
    """
    depth = 0
    for event in yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > MAX_DEPTH:
                raise TooDeepError(
                    f"line {event.start_mark.line + 1} is nested more than {MAX_DEPTH} levels deep, "
                    "which no file of this kind needs; flatten it"
                )
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1


def load(text: str, loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)) -> Any:  # noqa: B008
    """Returns the plain values of a YAML text; raises yaml.YAMLError."""
    check_depth(text)
    return yaml.load(text, loader)


def compose(text: str, loader: Any) -> yaml.Node | None:
    """Returns the nodes of a YAML text; raises yaml.YAMLError."""
    check_depth(text)
    return yaml.compose(text, loader)
