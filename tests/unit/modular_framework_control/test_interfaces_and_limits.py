# SPDX-License-Identifier: BSD-3-Clause
"""Handles, claims, parameters, joint limits, controller types and the joint state controller."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_control.controller_interface.controller import ControllerError
from modular_framework_control.controller_manager.controller_types import BUILT_IN_TYPES, ControllerTypes
from modular_framework_control.hardware_interface.handles import JointHandle, JointStateHandle
from modular_framework_control.hardware_interface.interfaces import (
    EffortJointInterface,
    HardwareInterfaceError,
    JointStateInterface,
    PositionJointInterface,
    interface_from_name,
)
from modular_framework_control.hardware_interface.joint_limits import (
    EffortJointSaturation,
    JointLimits,
    PositionJointSaturation,
    VelocityJointSaturation,
    limits_from_urdf,
    limits_with_parameters,
)
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_ros.node_handle import MappingNodeHandle, ParameterError, join_names, read_number


def test_a_command_handle_shows_the_shared_state() -> None:
    state = JointStateHandle("a")
    handle = JointHandle(state, command=0.5)
    state.position, state.velocity, state.effort = 1.0, 2.0, 3.0
    assert (handle.name, handle.position, handle.velocity, handle.effort, handle.command) == ("a", 1.0, 2.0, 3.0, 0.5)
    assert "0.5" in repr(handle) and "'a'" in repr(state)


def test_only_command_interfaces_claim() -> None:
    states, commands = JointStateInterface(), PositionJointInterface()
    handle = commands.register_handle(JointHandle(states.register_handle(JointStateHandle("a"))))
    assert states.get_handle("a") is handle.state
    assert commands.get_handle("a") is handle
    assert states.take_claims() == ()
    assert commands.take_claims() == ("a",)
    assert commands.take_claims() == ()


def test_unknown_and_double_joints_and_interfaces_are_named() -> None:
    states = JointStateInterface()
    states.register_handle(JointStateHandle("a"))
    with pytest.raises(HardwareInterfaceError, match="no joint 'b'; it has: a"):
        states.get_handle("b")
    with pytest.raises(HardwareInterfaceError, match="'a' is registered twice"):
        states.register_handle(JointStateHandle("a"))
    robot_hw = RobotHW()
    robot_hw.register_interface(states)
    with pytest.raises(HardwareInterfaceError, match="registered twice"):
        robot_hw.register_interface(JointStateInterface())
    with pytest.raises(HardwareInterfaceError, match="has no .*EffortJointInterface; it has: .*JointStateInterface"):
        robot_hw.get(EffortJointInterface)
    assert robot_hw.interfaces == [states]


def test_interfaces_are_found_by_both_forms_of_their_name() -> None:
    assert interface_from_name("hardware_interface/PositionJointInterface") is PositionJointInterface
    assert interface_from_name("EffortJointInterface") is EffortJointInterface
    with pytest.raises(HardwareInterfaceError, match="known: hardware_interface/EffortJointInterface"):
        interface_from_name("NoInterface")


URDF = """<robot name="r">
<joint name="turn" type="continuous"><limit velocity="3" effort="4"/></joint>
<joint name="bend" type="revolute"><limit lower="-1" upper="2" velocity="0.5" effort="7"/></joint>
<joint name="bare" type="prismatic"/><joint name="stiff" type="fixed"/></robot>"""


def test_limits_come_from_the_urdf() -> None:
    limits = limits_from_urdf(URDF)
    assert limits["bend"] == JointLimits(-1.0, 2.0, 0.5, 7.0)
    assert limits_from_urdf(URDF.replace('velocity="0.5" effort="7"', 'velocity="-0.5" effort="-7"')) == limits
    assert limits["turn"] == JointLimits(max_velocity=3.0, max_effort=4.0, continuous=True)
    assert limits["bare"] == JointLimits()
    assert "stiff" not in limits


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot", "not well-formed"),
        (URDF.replace('"0.5"', '"fast"'), ":3: <limit> of joint 'bend': velocity is 'fast'"),
        (URDF.replace('"-1"', '"nan"'), "'bend': lower is 'nan'; expected a number"),
    ],
)
def test_a_faulty_urdf_is_explained(text: str, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        limits_from_urdf(text)


def test_parameters_replace_limits_one_by_one() -> None:
    root = MappingNodeHandle(
        {
            "joint_limits": {
                "bend": {
                    "has_velocity_limits": True,
                    "max_velocity": 0.2,
                    "has_position_limits": True,
                    "min_position": -0.5,
                    "max_position": 1.5,
                    "has_effort_limits": True,
                    "max_effort": 1,
                }
            }
        }
    )
    assert limits_with_parameters("bend", JointLimits(-1.0, 2.0, 0.5, 7.0), root) == JointLimits(-0.5, 1.5, 0.2, 1.0)
    assert limits_with_parameters("turn", JointLimits(), root) == JointLimits()


@given(st.lists(st.one_of(st.floats(), st.just(math.nan)), min_size=1, max_size=20), st.floats(-1.0, 2.0))
def test_a_saturated_position_stays_in_range_and_never_jumps(wanted: list[float], start: float) -> None:
    handle = JointHandle(JointStateHandle("bend", start), start)
    saturation = PositionJointSaturation(handle, JointLimits(-1.0, 2.0, 0.5))
    last = start
    for command in wanted:
        handle.command = command
        saturation.enforce_limits(0.1)
        assert -1.0 <= handle.command <= 2.0
        assert abs(handle.command - last) <= 0.05 + 1e-12
        last = handle.command


def test_after_a_reset_saturation_starts_from_where_the_joint_is() -> None:
    handle = JointHandle(JointStateHandle("bend", 0.0), 0.0)
    saturation = PositionJointSaturation(handle, JointLimits(-1.0, 2.0, 0.5))
    saturation.enforce_limits(0.1)
    handle.state.position = handle.command = 1.5
    saturation.reset()
    saturation.enforce_limits(0.1)
    assert handle.command == 1.5


@pytest.mark.parametrize(("command", "saturated"), [(5.0, 2.0), (-5.0, -2.0), (1.0, 1.0), (math.nan, 0.0)])
def test_velocity_and_effort_are_bounded_on_both_sides(command: float, saturated: float) -> None:
    handle = JointHandle(JointStateHandle("bend"), command)
    VelocityJointSaturation(handle, JointLimits(max_velocity=2.0)).enforce_limits(0.1)
    assert handle.command == saturated
    handle.command = command
    EffortJointSaturation(handle, JointLimits(max_effort=2.0)).enforce_limits(0.1)
    assert handle.command == saturated


def test_parameters_are_found_below_their_namespace() -> None:
    root = MappingNodeHandle({"arm": {"constraints": {"goal_time": 0.5}}})
    arm = root.child("arm")
    assert arm.namespace == "/arm"
    assert arm.has_param("constraints/goal_time") and not arm.has_param("constraints/other")
    assert arm.child("constraints").get_param("goal_time") == 0.5
    assert root.child("absent/deeper").get_param("x", 3) == 3
    assert join_names("/a/", "/b//c") == "/a/b/c"


@pytest.mark.parametrize("value", [True, "1", math.nan, math.inf, -1.0, None, [1.0]])
def test_a_number_that_is_none_is_refused_with_its_full_name(value: object) -> None:
    with pytest.raises(ParameterError, match="parameter /arm/rate: got "):
        read_number(MappingNodeHandle({"rate": value}, "/arm"), "rate", 1.0)


def test_every_built_in_type_can_be_made() -> None:
    types = ControllerTypes()
    assert set(types.names) >= set(BUILT_IN_TYPES)
    for name in BUILT_IN_TYPES:
        assert type(types.create(name)).__name__.endswith(name.split("/")[1].removeprefix("Scaled"))
    types.reload()
    with pytest.raises(ControllerError, match="package/Class"):
        types.register("NoSlash", ControllerTypes().create)  # type: ignore[arg-type]


def test_joint_states_are_reported_at_their_rate_with_extra_joints(make_loop: Callable[..., Any]) -> None:
    loop = make_loop(
        {
            "hw": {"joints": ["b", "a"], "initial_positions": {"a": 0.25}},
            "states": {
                "type": "joint_state_controller/JointStateController",
                "publish_rate": 20.0,
                "extra_joints": [{"name": "wheel", "position": 1.5}, {"name": "a", "position": 9.0}],
            },
        }
    )
    loop.spawn("states")
    seen: list[Any] = []
    loop.controllers["states"].on_state = seen.append
    loop.run(1.0)
    assert len(seen) == pytest.approx(20, abs=1)
    assert seen[0].names == ["a", "b", "wheel"]
    assert seen[0].positions == [0.25, 0.0, 1.5]
    # the first one may be late: the controller is due from its start on, and the loop runs until the switch is answered
    times_s = [state.time_s for state in seen[1:]]
    assert np.diff(times_s) == pytest.approx(0.05, abs=0.011)
