# SPDX-License-Identifier: BSD-3-Clause
"""Reads untrusted YAML: too deep nesting is refused before it costs stack or time."""

from __future__ import annotations

from typing import Any

import yaml

MAX_DEPTH = 100
"""Deepest nesting of lists and mappings."""


class TooDeepError(yaml.YAMLError):
    """A text is nested too deeply; says where."""


def check_depth(text: str) -> None:
    """Checks how deeply a YAML text is nested, event by event.

    Raises:
        TooDeepError: It is nested deeper than ``MAX_DEPTH``.
        yaml.YAMLError: It is no YAML up to there.
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
