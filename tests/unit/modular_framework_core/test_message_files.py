# SPDX-License-Identifier: BSD-3-Clause
"""Files of a manager's messages: what is read is what was written, by the reader of JSON and by that of YAML."""

from __future__ import annotations

import math
import struct

import pytest
import rospy
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import CompressedImage, JointState
from std_msgs.msg import Bool, Float64, String

from modular_framework_core.managers import message_files
from modular_framework_core.managers.message_files import MessageFileError

finite = st.floats(allow_nan=False, allow_infinity=False)


def written(tmp_path, message):
    path = tmp_path / "messages.yaml"
    assert message_files.save(path, "thing", {"a: 'b'": message}, [message, message]) == 3
    return path


def read(path, message):
    named, anonymous = message_files.load(path, "thing", type(message))
    assert list(named) == ["a: 'b'"] and anonymous == [named["a: 'b'"]] * 2
    return anonymous[0]


@settings(deadline=None)
@given(number=finite)
def test_a_number_comes_back_to_the_last_bit_from_json_and_from_yaml(number):
    text = message_files.flow_text(Float64(number))
    for written in (text, f"{text}  # changed by hand"):
        assert struct.pack("d", message_files.parse_text(written)["data"]) == struct.pack("d", number)


@settings(deadline=None)
@given(text=st.text(st.characters(exclude_categories=["Cs"])))
def test_a_text_comes_back_as_it_was(text):
    assert message_files.parse_text(message_files.flow_text(String(text))) == {"data": text}


def test_times_lists_bytes_and_bools_come_back(tmp_path):
    state = JointState(name=["a", "b"], position=[0.1 + 0.2, 1e-300], velocity=(1e22, -0.0))
    state.header.stamp = rospy.Time(7, 999999999)
    back = read(written(tmp_path, state), state)
    assert (back.header, back.name, back.position) == (state.header, state.name, state.position)
    assert list(back.velocity) == list(state.velocity)
    assert read(written(tmp_path, String("null")), String("null")).data == "null"
    image = CompressedImage(data=b"\x00\xff7")
    assert bytes(read(written(tmp_path, image), image).data) == image.data
    assert read(written(tmp_path, Bool(True)), Bool(True)).data is True


@pytest.mark.parametrize("remark", ["", "# changed by hand\n"])
def test_what_is_not_finite_comes_back_too(tmp_path, remark):
    state = JointState(position=[math.inf, -math.inf, math.nan, 1e-07])
    path = written(tmp_path, state)
    path.write_text(remark + path.read_text())
    back = message_files.load(path, "thing", JointState)[1][0].position
    assert back[:2] == [math.inf, -math.inf] and math.isnan(back[2]) and back[3] == 1e-07


def test_a_file_written_by_hand_is_read(tmp_path):
    path = tmp_path / "hand.yaml"
    path.write_text("kind: thing\nnamed:\n  home:  # where it rests\n    name: [a]\n    position:\n    - 1\n")
    named, anonymous = message_files.load(path, "thing", JointState)
    assert (named["home"].name, named["home"].position, anonymous) == (["a"], [1], [])


def test_messages_written_by_hand_may_leave_fields_out_and_list_them_in_order(tmp_path):
    path = tmp_path / "hand.yaml"
    path.write_text("kind: thing\nanonymous:\n- {header: {stamp: {secs: 3}}}\n- {header: [7, 2000000000, world]}\n")
    first, second = (state.header for state in message_files.load(path, "thing", JointState)[1])
    assert (first.seq, first.stamp, first.frame_id) == (0, rospy.Time(3), "")
    assert (second.seq, second.stamp, second.frame_id) == (7, rospy.Time(2), "world")


@pytest.mark.parametrize(
    "value",
    [
        "{position: [a]}",
        "{name: 5}",
        "{position: 1.0}",
        "{header: {seq: 1.5}}",
        "{header: {seq: -1}}",
        "{name: abc}",
        "[1, 2]",
        "[]",
        "{joint: [a]}",
        "{position: null}",
        "{header: {stamp: {secs: -1, nsecs: 0}}}",
        "{header: {stamp: {secs: 1, hours: 2}}}",
    ],
)
def test_a_value_of_another_type_is_refused_by_name(tmp_path, value):
    path = tmp_path / "wrong.yaml"
    path.write_text(f"kind: thing\nnamed: {{good: {{}}, bad: {value}}}\n")
    with pytest.raises(MessageFileError, match="'bad' is not a valid sensor_msgs/JointState"):
        message_files.load(path, "thing", JointState)
