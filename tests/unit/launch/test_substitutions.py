# SPDX-License-Identifier: BSD-3-Clause
"""Substitutions have the values of ROS 2, and their errors say what was looked for."""

import re

import pytest
from launch import LaunchContext
from launch.substitutions import (
    AllSubstitution,
    AndSubstitution,
    AnonName,
    AnySubstitution,
    Command,
    EnvironmentVariable,
    EqualsSubstitution,
    FileContent,
    FindExecutable,
    IfElseSubstitution,
    LaunchConfiguration,
    LocalSubstitution,
    NotEqualsSubstitution,
    NotSubstitution,
    OrSubstitution,
    PathJoinSubstitution,
    PythonExpression,
    SubstitutionFailure,
    TextSubstitution,
    ThisLaunchFileDir,
)


@pytest.fixture
def context() -> LaunchContext:
    context = LaunchContext()
    context.launch_configurations.update(robot="panda", count="3", fake="true")
    return context


@pytest.mark.parametrize(
    ("substitution", "value"),
    [
        (TextSubstitution(text="a b"), "a b"),
        (LaunchConfiguration("robot"), "panda"),
        (LaunchConfiguration(["ro", TextSubstitution(text="bot")]), "panda"),
        (LaunchConfiguration("missing", default="none"), "none"),
        (LaunchConfiguration("missing", default=["/", LaunchConfiguration("robot")]), "/panda"),
        (LaunchConfiguration("missing", default=5), "5"),
        (EnvironmentVariable("HOME_OF_NOBODY", default_value="/nowhere"), "/nowhere"),
        (PathJoinSubstitution(["/share", [LaunchConfiguration("robot"), ".yaml"]]), "/share/panda.yaml"),
        (PathJoinSubstitution(["/share", LaunchConfiguration("robot")]) / "config", "/share/panda/config"),
        (PythonExpression(["2 * ", LaunchConfiguration("count"), " + floor(0.5)"]), "6"),
        (PythonExpression(["'", LaunchConfiguration("robot"), "' in ['panda', 'ur5']"]), "True"),
        (Command(["echo ", LaunchConfiguration("robot")]), "panda\n"),
        (Command("sh -c 'echo out; echo err >&2'", on_stderr="ignore"), "out\n"),
        (Command("sh -c 'echo err >&2'", on_stderr="capture"), "err\n"),
        (NotSubstitution(LaunchConfiguration("fake")), "false"),
        (AndSubstitution("true", LaunchConfiguration("fake")), "true"),
        (OrSubstitution("false", "0"), "false"),
        (AllSubstitution("1", "yes", "on"), "true"),
        (AnySubstitution("false", "no", LaunchConfiguration("fake")), "true"),
        (EqualsSubstitution(LaunchConfiguration("robot"), "panda"), "true"),
        (EqualsSubstitution(LaunchConfiguration("fake"), "1"), "true"),
        (EqualsSubstitution(LaunchConfiguration("count"), 3.0), "true"),
        (NotEqualsSubstitution(LaunchConfiguration("robot"), "ur5"), "true"),
        (IfElseSubstitution(LaunchConfiguration("fake"), "mock", "real"), "mock"),
    ],
)
def test_a_substitution_has_its_value(context: LaunchContext, substitution, value: str) -> None:
    assert substitution.perform(context) == value


def test_an_environment_variable_is_that_of_the_launch(context: LaunchContext, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARM_OF_THE_TEST", "left")
    assert EnvironmentVariable("ARM_OF_THE_TEST").perform(context) == "left"


def test_a_program_is_found_in_path(context: LaunchContext) -> None:
    assert FindExecutable("sh").perform(context).endswith("/sh")


def test_a_file_is_read(context: LaunchContext, tmp_path) -> None:
    (tmp_path / "robot.urdf").write_text("<robot/>")
    assert FileContent([str(tmp_path), "/robot.urdf"]).perform(context) == "<robot/>"


def test_an_anonymous_name_is_the_same_within_a_launch_and_another_in_the_next(context: LaunchContext) -> None:
    name = AnonName("spawner").perform(context)
    assert name == AnonName("spawner").perform(context) != AnonName("spawner").perform(LaunchContext())
    assert re.fullmatch(r"spawner_\w+", name)


@pytest.mark.parametrize(
    ("substitution", "messages"),
    [
        (LaunchConfiguration("robott"), ["'robott' is not set", "did you mean 'robot'", "count, fake, robot"]),
        (EnvironmentVariable("PATHH"), ["'PATHH' is not set", "did you mean 'PATH'"]),
        (FindExecutable("no-such-program"), ["program 'no-such-program' is not found", "PATH"]),
        (FileContent("/etc/hostnam"), ["/etc/hostnam cannot be read", "did you mean '/etc/hostname'"]),
        (Command("false"), ["'false' ended with exit code 1"]),
        (Command("no-such-program x"), ["'no-such-program x' cannot be run"]),
        (Command("sh -c 'echo wrong >&2'"), ["printed errors: wrong", "on_stderr='warn'"]),
        (Command("true", on_stderr="ignor"), ["on_stderr is 'ignor'", "did you mean 'ignore'"]),
        (PythonExpression("panda == 'panda'"), ["NameError", "add quotes around texts"]),
        (NotSubstitution("maybe"), ["'maybe'", "true", "false"]),
        (LocalSubstitution("event.returncode"), ["no 'event'"]),
        (ThisLaunchFileDir(), ["does not come from a file"]),
    ],
)
def test_a_substitution_without_a_value_says_what_was_looked_for(
    context: LaunchContext, substitution, messages: list[str]
) -> None:
    with pytest.raises(RuntimeError) as caught:
        substitution.perform(context)
    for message in messages:
        assert message in str(caught.value)


def test_the_error_of_a_missing_value_is_of_its_public_type(context: LaunchContext) -> None:
    with pytest.raises(SubstitutionFailure):
        LaunchConfiguration("nothing").perform(context)


def test_a_number_where_a_text_is_wanted_is_refused_with_its_line() -> None:
    with pytest.raises(TypeError, match=r"test_substitutions.py:\d+: got 3 of type int; allowed: a text"):
        PathJoinSubstitution(["/share", [3]])
