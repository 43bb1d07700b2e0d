# SPDX-License-Identifier: BSD-3-Clause
"""The emulated controller's side of RTDE, byte by byte as its maker documents the protocol."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modular_framework_testing.emulators.ur_controller import HOME, MODELS, UrController
from modular_framework_testing.emulators.ur_rtde_server import RtdeProtocolError, RtdeServer, RtdeSession


def package(kind: str, payload: bytes = b"") -> bytes:
    return struct.pack(">HB", 3 + len(payload), ord(kind)) + payload


@pytest.fixture
def server() -> RtdeServer:
    return RtdeServer(UrController(MODELS["UR5e"], HOME))


def test_it_speaks_version_two_only(server: RtdeServer) -> None:
    session = RtdeSession(server)
    assert session.receive(package("V", b"\x00\x02")) == package("V", b"\x01")
    assert session.receive(package("V", b"\x00\x03")) == package("V", b"\x00")


def test_it_reports_the_version_of_its_software(server: RtdeServer) -> None:
    assert RtdeSession(server).receive(package("v")) == package("v", struct.pack(">4I", 5, 12, 4, 1101661))


def test_it_sends_what_was_asked_for_as_often_as_asked_for(server: RtdeServer) -> None:
    session = RtdeSession(server)
    reply = session.receive(package("O", struct.pack(">d", 125.0) + b"actual_q,robot_mode,"))
    assert reply == package("O", b"\x01VECTOR6D,INT32")
    assert session.cycle() == b""
    assert session.receive(package("S")) == package("S", b"\x01")
    sent = [session.cycle() for _ in range(8)]
    expected = package("U", b"\x01" + struct.pack(">6di", *HOME, 7))
    assert sent == [b"", b"", b"", expected] * 2
    assert session.receive(package("P")) == package("P", b"\x01")
    assert session.cycle() == b""


def test_an_unknown_variable_is_not_found_and_nothing_is_sent(server: RtdeServer) -> None:
    session = RtdeSession(server)
    reply = session.receive(package("O", struct.pack(">d", 500.0) + b"actual_q,colour"))
    assert reply == package("O", b"\x01VECTOR6D,NOT_FOUND")
    assert session.receive(package("S")) == package("S", b"\x00")


def test_an_input_belongs_to_one_client_until_it_leaves(server: RtdeServer) -> None:
    first, second = RtdeSession(server), RtdeSession(server)
    setup = package("I", b"input_int_register_0,input_double_register_3")
    assert first.receive(setup) == package("I", b"\x01INT32,DOUBLE")
    assert first.receive(setup) == package("I", b"\x02INT32,DOUBLE")
    assert second.receive(setup) == package("I", b"\x00IN_USE,IN_USE")
    first.close()
    assert second.receive(setup) == package("I", b"\x01INT32,DOUBLE")


def test_a_data_package_sets_the_inputs_of_its_recipe(server: RtdeServer) -> None:
    session = RtdeSession(server)
    session.receive(package("I", b"input_int_register_5,speed_slider_mask,speed_slider_fraction"))
    session.receive(package("U", b"\x01" + struct.pack(">iId", -7, 1, 0.25)))
    assert server.controller.inputs.ints[5] == -7
    assert server.controller.speed_slider == 0.25


def test_packages_may_come_in_pieces(server: RtdeServer) -> None:
    session = RtdeSession(server)
    data = package("V", b"\x00\x02") + package("v")
    replies = b"".join(session.receive(data[index : index + 1]) for index in range(len(data)))
    assert replies == package("V", b"\x01") + package("v", struct.pack(">4I", 5, 12, 4, 1101661))


@settings(deadline=None)
@given(garbage=st.binary(min_size=3, max_size=200))
def test_garbage_is_answered_as_far_as_it_is_rtde_and_else_ends_the_connection(garbage: bytes) -> None:
    session = RtdeSession(RtdeServer(UrController(MODELS["UR5"], HOME)))
    try:
        replies = session.receive(garbage)
    except RtdeProtocolError:
        return
    while replies:
        size, kind = struct.unpack_from(">HB", replies)
        assert chr(kind) in "VvOISP"
        replies = replies[size:]


def test_a_data_package_of_no_recipe_or_of_the_wrong_length_ends_the_connection(server: RtdeServer) -> None:
    session = RtdeSession(server)
    with pytest.raises(RtdeProtocolError, match="unknown recipe"):
        session.receive(package("U", b"\x09\x00"))
    session.receive(package("I", b"input_int_register_5"))
    with pytest.raises(RtdeProtocolError, match="3 bytes; expected 4"):
        session.receive(package("U", b"\x01\x00\x00\x00"))
