# SPDX-License-Identifier: BSD-3-Clause
"""The names of capabilities that are checked before a launch are those that move_group has."""

from __future__ import annotations

from modular_framework_planning.move_group.node import CAPABILITIES
from modular_framework_planning.move_group.plugin_names import DEFAULT_CAPABILITIES, OPTIONAL_CAPABILITIES


def test_the_listed_capabilities_are_those_of_the_node() -> None:
    assert {item.name for item in CAPABILITIES if item.default} == set(DEFAULT_CAPABILITIES)
    assert {item.name for item in CAPABILITIES if not item.default} == set(OPTIONAL_CAPABILITIES)
