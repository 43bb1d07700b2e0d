# SPDX-License-Identifier: BSD-3-Clause
"""Userdata: what a state may read and write, and what it gets."""

from __future__ import annotations

import pytest

import smach
from smach.user_data import Const, get_const


class Tool:
    """An ordinary object with an attribute and a method."""

    def __init__(self) -> None:
        self.angle = 1.0

    def turn(self) -> str:
        return "turned"


class Message:
    """Looks like a ROS message: slots, no instance dictionary."""

    __slots__ = ("data",)

    def __init__(self) -> None:
        self.data = 3


def view(keys_in: list[str], keys_out: list[str], remapping: dict[str, str] | None = None) -> smach.Remapper:
    userdata = smach.UserData()
    userdata.tool = Tool()
    userdata.message = Message()
    userdata.number = 5
    return smach.Remapper(userdata, keys_in, keys_out, remapping or {})


def test_values_are_read_and_written_as_attributes_and_as_items() -> None:
    userdata = smach.UserData()
    userdata.a = 1
    userdata["b"] = 2
    assert (userdata["a"], userdata.b) == (1, 2)
    assert sorted(userdata.keys()) == ["a", "b"]
    assert "a" in userdata and "c" not in userdata


def test_a_missing_key_is_named_with_those_there_are() -> None:
    userdata = smach.UserData()
    userdata.speed = 1
    with pytest.raises(AttributeError, match=r"no key 'sped'; it has: \['speed'\]"):
        _ = userdata.sped
    with pytest.raises(KeyError):
        _ = userdata["sped"]


def test_update_takes_over_all_values() -> None:
    one, two = smach.UserData(), smach.UserData()
    one.a, one.b, two.b, two.c = 1, 1, 2, 2
    one.update(two)
    assert (one.a, one.b, one.c) == (1, 2, 2)


def test_extract_and_merge_rename_and_copy() -> None:
    source, target = smach.UserData(), smach.UserData()
    source.outer = [1]
    extracted = source.extract(["outer"], {"inner": "outer"})
    assert extracted.inner == [1] and extracted.inner is not source.outer
    target.merge(source, ["outer"], {"outer": "mine"})
    assert target.mine == [1] and target.mine is not source.outer


def test_an_object_declared_as_input_only_is_read_only() -> None:
    tool = view(["tool"], []).tool
    assert tool.angle == 1.0
    with pytest.raises(TypeError, match="io_keys"):
        tool.turn()
    with pytest.raises(TypeError, match="io_keys"):
        tool.angle = 2.0
    with pytest.raises(TypeError, match="io_keys"):
        del tool.angle


def test_an_object_declared_as_input_and_output_is_the_object_itself() -> None:
    tool = view(["tool"], ["tool"]).tool
    assert isinstance(tool, Tool)
    assert tool.turn() == "turned"


def test_messages_and_plain_values_are_not_wrapped() -> None:
    seen = view(["message", "number"], [])
    assert isinstance(seen.message, Message)
    assert type(seen.number) is int


def test_a_read_only_object_compares_and_hashes_like_the_object() -> None:
    tool = Tool()
    assert get_const(tool) == tool
    assert get_const(tool) == Const(tool)
    assert hash(get_const(tool)) == hash(tool)
    assert bool(get_const(tool))
    assert get_const(Tool) is Tool


def test_reading_an_undeclared_key_is_an_error_of_the_user_code() -> None:
    with pytest.raises(smach.InvalidUserCodeError, match=r"'number' was read.*\['tool'\]"):
        _ = view(["tool"], []).number


def test_writing_an_undeclared_key_is_an_error_of_the_user_code() -> None:
    with pytest.raises(smach.InvalidUserCodeError, match="'number' was written"):
        view(["number"], []).number = 3


def test_remapping_gives_a_state_its_own_names() -> None:
    seen = view(["mine"], ["mine"], {"mine": "number"})
    assert seen.mine == 5
    seen["mine"] = 6
    assert seen["mine"] == 6
    assert seen.keys() == ["mine"]
    assert "mine" in seen and "number" not in seen


def test_a_declared_key_without_a_value_is_reported_with_both_names() -> None:
    with pytest.raises(AttributeError, match="'mine' has no value yet.*'nothing'"):
        _ = view(["mine"], [], {"mine": "nothing"}).mine
