# SPDX-License-Identifier: BSD-3-Clause
"""Commands to an emulator over its command port, and the answers to invalid ones."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from modular_framework_testing.emulators.command_port import CommandError, CommandPort, parse_value, send_command


@pytest.fixture
def port() -> Iterator[int]:
    def add(one: float, other: float = 1) -> str:
        """Adds."""
        return str(one + other)

    def fail() -> None:
        raise ValueError("not today")

    def write() -> None:
        raise OSError(28, "No space left on device")

    server = CommandPort({"add": add, "fail": fail, "write": write})
    server.connect()
    yield server.port
    server.close()
    server.close()


def test_a_command_gets_its_arguments_as_values(port: int) -> None:
    assert send_command(port, "add", one=1, other=2.5) == "3.5"
    assert send_command(port, "add", one=True) == "2"


@pytest.mark.parametrize(
    ("command", "arguments", "reason"),
    [
        ("divide", {}, "unknown command 'divide'; known: help, add, fail, write"),
        ("add", {}, "missing a required argument: 'one'"),
        ("add", {"one": 1, "third": 2}, "unexpected keyword argument 'third'"),
        ("add 3", {}, "arguments are written key=value"),
        ("fail", {}, "fail: not today"),
        ("write", {}, "No space left on device"),
        ("", {}, "help"),
    ],
)
def test_what_cannot_be_done_is_answered_with_the_reason(
    port: int, command: str, arguments: dict[str, object], reason: str
) -> None:
    with pytest.raises(CommandError) as error:
        send_command(port, command, **arguments)
    assert reason in str(error.value)


def test_help_lists_the_commands(port: int) -> None:
    assert "add(one: 'float', other: 'float' = 1) -> 'str': Adds." in send_command(port, "help")


def test_a_taken_port_is_named(port: int) -> None:
    with pytest.raises(OSError, match=f"127.0.0.1:{port}: .*choose another"):
        CommandPort({}, port).connect()


def test_values_are_what_they_look_like() -> None:
    assert [parse_value(text) for text in ("true", "false", "3", "0.5", "-1e3", "slow")] == [
        True,
        False,
        3,
        0.5,
        -1000.0,
        "slow",
    ]
