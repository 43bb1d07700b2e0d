# SPDX-License-Identifier: BSD-3-Clause
"""A node that is interrupted while it starts ends without a traceback; one that cannot start says why."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from types import ModuleType

import pytest
import rospy

from modular_framework_ros.node_start import run_node


@pytest.fixture(autouse=True)
def interrupts() -> Iterator[None]:
    """Gives pytest its handler of SIGINT back."""
    before = signal.getsignal(signal.SIGINT)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture()
def node(monkeypatch: pytest.MonkeyPatch) -> str:
    """Name of a module whose main() fails as rospy.init_node() does."""

    def main() -> int:
        raise rospy.exceptions.ROSInitException("init_node interrupted before it could complete")

    module = ModuleType("node_that_does_not_start")
    module.main = main  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    return module.__name__


def test_an_interrupt_while_rospy_starts_the_node_ends_it_like_a_shell_would_say(
    node: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rospy.core, "is_shutdown", lambda: True)
    with pytest.raises(SystemExit) as ended:
        run_node(node)
    assert ended.value.code == 130


def test_a_node_that_cannot_start_says_why(node: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rospy.core, "is_shutdown", lambda: False)
    with pytest.raises(rospy.exceptions.ROSInitException, match="before it could complete"):
        run_node(node)
