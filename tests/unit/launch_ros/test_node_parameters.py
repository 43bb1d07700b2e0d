# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of nodes go where nodes of ROS 1 look for them, with the values and rules of ROS 2's launch files."""

from pathlib import Path

import pytest
from launch import LaunchContext
from launch.substitutions import LaunchConfiguration, TextSubstitution
from launch_ros.actions import Node, PushRosNamespace, SetParameter, SetRemap, SetUseSimTime
from launch_ros.parameter_descriptions import Parameter, ParameterFile, ParameterValue

URDF = "<robot name='arm'/>"
PROGRAM = {"package": "tf2_ros", "executable": "buffer_server"}


@pytest.fixture
def context() -> LaunchContext:
    context = LaunchContext()
    context.launch_configurations.update(rate="12.5", name="7", fake="true", urdf=URDF, list="[1, 2]", broken="a: b: c")
    return context


def planned(context: LaunchContext, *actions) -> dict:
    for action in actions:
        action.visit(context)
    return context.parameters.values()


def own(context: LaunchContext, *parameters) -> dict:
    """The private parameters of a node that is given some."""
    values = planned(context, Node(**PROGRAM, name="node", parameters=list(parameters)))
    return {name.removeprefix("/node/"): value for name, value in values.items() if name.startswith("/node/")}


@pytest.mark.parametrize(
    ("value", "evaluated"),
    [
        (3, 3),
        ("12.5", "12.5"),  # a text is a text
        ("", ""),
        (LaunchConfiguration("rate"), 12.5),  # what a substitution gives is YAML
        (LaunchConfiguration("fake"), True),
        (LaunchConfiguration("list"), [1, 2]),
        (LaunchConfiguration("urdf"), URDF),  # XML stays a text
        (ParameterValue(LaunchConfiguration("name"), value_type=str), "7"),
        (ParameterValue(LaunchConfiguration("name"), value_type=float), 7.0),
        (ParameterValue(LaunchConfiguration("list"), value_type=list[float]), [1.0, 2.0]),
        (ParameterValue(LaunchConfiguration("broken"), value_type=str), "a: b: c"),
        ([1, 2.5], [1.0, 2.5]),
        (["a", "b"], ["a", "b"]),
        (["arm", LaunchConfiguration("name")], "arm7"),  # texts and substitutions are one text
        ([[LaunchConfiguration("name")], ["8"]], [7, ["8"]]),
        ([{"name": "arm", "joints": ["a"]}], [{"name": "arm", "joints": ["a"]}]),
    ],
)
def test_a_value_is_evaluated_as_in_ros_2(context: LaunchContext, value, evaluated) -> None:
    assert own(context, {"parameter": value}) == {"parameter": evaluated}


def test_nested_names_dots_and_names_of_substitutions_are_names_below_each_other(context: LaunchContext) -> None:
    key = ("arm", LaunchConfiguration("name"))
    given = [
        {"a": {"b": 1, "c": {"d": 2}}, "a.e": 3, key: 4},
        Parameter("f", LaunchConfiguration("rate")),
        {"a": {"b": 9}},
    ]
    assert own(context, *given) == {"a/b": 9, "a/c/d": 2, "a/e": 3, "arm7": 4, "f": 12.5}


def test_a_file_of_ros_2_gives_each_node_its_sections(context: LaunchContext, tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(
        "/node: {ros__parameters: {exact: 1, both: exact}}\n"
        "/**: {ros__parameters: {wild: 2, both: wild}}\n"
        "other: {ros__parameters: {foreign: 3}}\n"
        "left: {node: {ros__parameters: {left: 4}}}\n"
    )
    assert own(context, str(file)) == {"exact": 1, "both": "exact", "wild": 2}
    left = Node(**PROGRAM, name="node", namespace="left", parameters=[ParameterFile(file)])
    assert planned(LaunchContext(), left) == {"/left/node/wild": 2, "/left/node/both": "wild", "/left/node/left": 4}


@pytest.mark.parametrize(
    ("pattern", "nodes"),
    [
        ("/**/node", "/node /left/node /left/arm/node"),
        ("/*/node", "/left/node"),
        ("/**", "/node /left/node /left/arm/node /other"),
        ("/left/**", "/left/node /left/arm/node"),
        ("node", "/node"),
    ],
)
def test_two_stars_stand_for_any_number_of_namespaces(tmp_path: Path, pattern: str, nodes: str) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(f"{pattern}: {{ros__parameters: {{found: true}}}}\n")
    context = LaunchContext()
    for namespace, name in (("", "node"), ("left", "node"), ("left/arm", "node"), ("", "other")):
        Node(**PROGRAM, name=name, namespace=namespace, parameters=[str(file)]).visit(context)
    assert set(context.parameters.values()) == {f"{node}/found" for node in nodes.split()}


def test_any_other_file_belongs_to_the_node(context: LaunchContext, tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("arm:\n  joints: [a, b]\n")
    assert own(context, [TextSubstitution(text=str(tmp_path)), "/p.yaml"]) == {"arm/joints": ["a", "b"]}


def test_the_description_of_the_robot_is_also_in_the_namespace(context: LaunchContext) -> None:
    shared = {"robot_description": URDF, "robot_description_kinematics": {"arm": {"kinematics_solver": "x"}}}
    values = planned(context, Node(**PROGRAM, name="a", namespace="left", parameters=[shared, {"rate": 1}]))
    for where in ("/left", "/left/a"):
        assert values[f"{where}/robot_description"] == URDF
        assert values[f"{where}/robot_description_kinematics/arm/kinematics_solver"] == "x"
    assert "/left/rate" not in values


def test_a_description_of_another_name_is_known_by_its_text(context: LaunchContext) -> None:
    parameters = {"tool": URDF, "tool_semantic": URDF, "tool_planning": {"a": 1}, "tooling": 2}
    values = planned(context, Node(**PROGRAM, name="a", parameters=[parameters]))
    assert {name for name in values if name.count("/") == 1 or name == "/tool_planning/a"} == {
        "/tool",
        "/tool_semantic",
        "/tool_planning/a",
    }


def test_nodes_that_give_parts_of_one_description_complete_each_other(context: LaunchContext) -> None:
    def node(name: str, planning: dict) -> Node:
        return Node(**PROGRAM, name=name, parameters=[{"robot_description_planning": planning}])

    limits, tool = {"joint_limits": {"j": {"max_velocity": 1.0}}}, {"cartesian_limits": {"max_trans_vel": 1.0}}
    values = planned(context, node("a", limits), node("b", {**limits, **tool}))
    assert values["/robot_description_planning/joint_limits/j/max_velocity"] == 1.0
    assert values["/robot_description_planning/cartesian_limits/max_trans_vel"] == 1.0


def test_two_descriptions_in_one_namespace_are_an_error_that_names_both_nodes(context: LaunchContext) -> None:
    def node(name: str, text: str, **options) -> Node:
        return Node(**PROGRAM, name=name, parameters=[{"robot_description": text}], **options)

    planned(context, node("rviz", URDF), node("other", "<robot name='b'/>", namespace="right"))
    with pytest.raises(RuntimeError) as caught:
        planned(context, node("move_group", "<robot name='b'/>"))
    for message in ("test_node_parameters.py:", "parameter /robot_description", "node /rviz", "node /move_group"):
        assert message in str(caught.value)


def test_all_nodes_have_one_clock(context: LaunchContext) -> None:
    assert planned(context, Node(**PROGRAM, name="a", parameters=[{"use_sim_time": True}])) == {"/use_sim_time": True}
    with pytest.raises(RuntimeError, match="parameter /use_sim_time: node /a sets True"):
        planned(context, SetUseSimTime(False))


def test_scopes_give_namespace_parameters_and_remappings(context: LaunchContext) -> None:
    scope = [PushRosNamespace("left"), PushRosNamespace("arm"), SetParameter("gain", 2), SetRemap("a", "b")]
    node = Node(**PROGRAM, name="n", parameters=[{"gain": 3}], remappings=[("c", LaunchConfiguration("name"))])
    absolute = Node(**PROGRAM, name="m", namespace="/right")
    assert planned(context, *scope, node, absolute) == {"/left/arm/n/gain": 3, "/right/m/gain": 2}
    request, other = context.requests
    assert request.command[1:] == ["a:=b", "c:=7", "__name:=n"]
    assert (request.environment["ROS_NAMESPACE"], other.environment["ROS_NAMESPACE"]) == ("/left/arm", "/right")
    assert (node.node_name, other.node_name) == ("/left/arm/n", "/right/m")


def test_a_node_without_name_names_itself_unless_it_has_parameters(context: LaunchContext) -> None:
    planned(context, Node(**PROGRAM), Node(**PROGRAM, parameters=[{"a": 1}]))
    unnamed, named = context.requests
    assert (unnamed.node_name, named.node_name) == ("", "/buffer_server")
    assert context.parameters.values() == {"/buffer_server/a": 1}


def test_ros_arguments_of_ros_2_are_understood(context: LaunchContext) -> None:
    ros_arguments = ["-r", "__ns:=/left", "-r", "a:=b", "-p", "gain:=2.5", "--log-level", "debug"]
    arguments = ["--flag", "--ros-args", "-r", "__node:=n", "--", "last"]
    assert planned(context, Node(**PROGRAM, arguments=arguments, ros_arguments=ros_arguments)) == {"/left/n/gain": 2.5}
    assert context.requests[0].command[1:] == ["--flag", "last", "a:=b", "__name:=n"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"parameters": [{"a": None}]}, "node /n: parameter /n/a: got no value"),
        ({"parameters": [{"a": LaunchConfiguration("broken")}]}, "not valid YAML.*ParameterValue"),
        ({"parameters": [{"a": ParameterValue(LaunchConfiguration("rate"), value_type=int)}]}, "allowed: int"),
        ({"parameters": ["/no/such/file.yaml"]}, "parameter file /no/such/file.yaml cannot be read"),
        ({"parameters": {"a": 1}}, "a list of dicts and files"),
        ({"name": "left/n"}, r"node name 'left/n'.*namespace=\.\.\."),
        ({"namespace": "2nd"}, "namespace '/2nd' is invalid"),
        ({"ros_arguments": ["--remapp", "a:=b"]}, "did you mean '--remap'"),
    ],
)
def test_what_cannot_be_set_is_refused_with_the_line(context: LaunchContext, options: dict, message: str) -> None:
    with pytest.raises(RuntimeError, match=f"(?s)test_node_parameters.py:.*{message}"):
        planned(context, Node(**PROGRAM, **{"name": "n", **options}))


def test_what_ros_1_has_not_is_refused_with_what_to_do() -> None:
    with pytest.raises(RuntimeError, match="ComposableNodeContainer is not supported: ROS 1 has no components"):
        from launch_ros.actions import ComposableNodeContainer  # noqa: F401
