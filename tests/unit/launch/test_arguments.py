# SPDX-License-Identifier: BSD-3-Clause
"""Arguments, conditions and scopes mean what they mean in ROS 2; mistakes are named with file and line."""

from collections.abc import Callable

import pytest
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    GroupAction,
    LogInfo,
    OpaqueFunction,
    SetEnvironmentVariable,
    SetLaunchConfiguration,
    UnsetLaunchConfiguration,
)
from launch.conditions import IfCondition, LaunchConfigurationEquals, LaunchConfigurationNotEquals, UnlessCondition
from launch.substitutions import EnvironmentVariable, LaunchConfiguration, PythonExpression

Run = Callable[..., tuple[int, str]]
ARM = LaunchConfiguration("arm", default="none")


def test_an_argument_has_its_default_or_what_is_given(run: Run, note, seen: list[str]) -> None:
    entities = [DeclareLaunchArgument("arm", default_value=["le", "ft"]), note(ARM)]
    assert run(entities)[0] == 0
    assert run(entities, arm="right")[0] == 0
    assert seen == ["left", "right"]


@pytest.mark.parametrize(
    ("argument", "given", "messages"),
    [
        (DeclareLaunchArgument("arm"), {}, ["argument 'arm' has no value", "arm:=VALUE"]),
        (
            DeclareLaunchArgument("arm", description="which arm", choices=["left", "right"]),
            {"arm": "lefft"},
            ["argument 'arm' is 'lefft'", "allowed: left, right", "did you mean 'left'"],
        ),
    ],
)
def test_a_wrong_argument_is_named_with_file_and_line(run: Run, argument, given: dict, messages: list[str]) -> None:
    code, said = run([argument], **given)
    assert code == 2
    for message in [*messages, "test_arguments.py:"]:
        assert message in said


def test_a_default_outside_of_the_choices_is_refused_at_once() -> None:
    with pytest.raises(RuntimeError, match=r"test_arguments.py:\d+: default_value is 'both'; allowed: left, right"):
        DeclareLaunchArgument("arm", default_value="both", choices=["left", "right"])


def test_the_description_of_an_argument_lists_its_choices() -> None:
    argument = DeclareLaunchArgument("arm", description="Which arm.", choices=["left", "right"])
    assert argument.description == "Which arm. Valid choices are: ['left', 'right']"


def test_arguments_are_listed_also_from_groups_and_conditions() -> None:
    description = LaunchDescription(
        [
            DeclareLaunchArgument("a"),
            GroupAction([DeclareLaunchArgument("b")]),
            GroupAction([DeclareLaunchArgument("c")], condition=IfCondition("true")),
        ]
    )
    listed = {each.name: each.conditionally_included for each in description.get_launch_arguments()}
    assert listed == {"a": False, "b": False, "c": True}


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        (IfCondition("True"), True),
        (IfCondition(" 0 "), False),
        (UnlessCondition("false"), True),
        (UnlessCondition(LaunchConfiguration("fake")), False),
        (IfCondition(PythonExpression(["'", LaunchConfiguration("robot"), "' == 'ur5'"])), True),
        (LaunchConfigurationEquals("robot", "ur5"), True),
        (LaunchConfigurationEquals("robot", ["pan", "da"]), False),
        (LaunchConfigurationEquals("missing", None), True),
        (LaunchConfigurationEquals("missing", "x"), False),
        (LaunchConfigurationNotEquals("robot", "panda"), True),
        (LaunchConfigurationNotEquals("missing", None), False),
    ],
)
def test_a_condition_decides_whether_an_action_is_done(run: Run, condition, holds: bool) -> None:
    code, said = run([LogInfo(msg="done", condition=condition)], robot="ur5", fake="true")
    assert code == 0
    assert ("done" in said) is holds


def test_a_condition_that_says_neither_is_refused(run: Run) -> None:
    code, said = run([LogInfo(msg="done", condition=IfCondition(LaunchConfiguration("fake")))], fake="perhaps")
    assert code == 2
    assert "is 'perhaps'; allowed: true, 1, false, 0" in said
    assert "test_arguments.py:" in said


def test_a_text_in_place_of_a_condition_is_refused() -> None:
    with pytest.raises(TypeError, match=r"such as IfCondition\(...\)"):
        LogInfo(msg="done", condition="true")


def test_a_scoped_group_forgets_what_it_set(run: Run, note, seen: list[str]) -> None:
    def group(**options):
        inside = [note(ARM), SetLaunchConfiguration("arm", "inside"), note(ARM)]
        return [SetLaunchConfiguration("arm", "outside"), GroupAction(inside, **options), note(ARM)]

    for options in ({}, {"forwarding": False}, {"scoped": False}, {"launch_configurations": {"arm": "given"}}):
        assert run(group(**options))[0] == 0
    assert seen == [
        *("outside", "inside", "outside"),
        *("none", "inside", "outside"),
        *("outside", "inside", "inside"),
        *("given", "inside", "outside"),
    ]


def test_a_group_has_an_environment_of_its_own(run: Run, note, seen: list[str]) -> None:
    value = EnvironmentVariable("ARM_OF_THE_TEST", default_value="unset")
    group = GroupAction([SetEnvironmentVariable("ARM_OF_THE_TEST", "left"), note(value)])
    assert run([group, note(value)])[0] == 0
    assert seen == ["left", "unset"]


def test_an_unset_configuration_is_gone(run: Run, note, seen: list[str]) -> None:
    run([SetLaunchConfiguration("arm", "left"), UnsetLaunchConfiguration("arm"), note(ARM)])
    assert seen == ["none"]


def test_a_function_makes_entities_of_the_configuration(run: Run) -> None:
    def greet(context, greeting: str, name: str):
        return [LogInfo(msg=f"{greeting} {name} at {context.launch_configurations['arm']}")]

    code, said = run([OpaqueFunction(function=greet, args=["hello"], kwargs={"name": "you"})], arm="left")
    assert (code, "hello you at left" in said) == (0, True)


def test_a_function_that_fails_is_named_with_its_own_line(run: Run) -> None:
    def broken(context):
        return {}["arm"]

    code, said = run([OpaqueFunction(function=broken)])
    line = broken.__code__.co_firstlineno + 1
    assert code == 2
    assert f"test_arguments.py:{line}: OpaqueFunction(broken): KeyError: 'arm'" in said
    code, said = run([OpaqueFunction(function=lambda context: ["a text"])])
    assert code == 2 and "got 'a text' of type str; allowed: actions and launch descriptions" in said


def test_what_a_launch_does_not_offer_is_refused_with_what_to_do() -> None:
    with pytest.raises(
        RuntimeError, match=r"test_arguments.py:\d+: .*OpaqueCoroutine is not supported: .*OpaqueFunction"
    ):
        from launch.actions import OpaqueCoroutine  # noqa: F401
    with pytest.raises(RuntimeError, match="OnProcessIO is not supported"):
        from launch.event_handlers import OnProcessIO  # noqa: F401
