# SPDX-License-Identifier: BSD-3-Clause
"""Programs, controller files and hardware tags of ROS 2 become those of ROS 1."""

from pathlib import Path
from textwrap import indent

import pytest
from launch import LaunchContext
from launch_ros.actions import Node

TRAJECTORY = "joint_trajectory_controller/JointTrajectoryController"
CONTROLLERS = f"""
controller_manager:
  ros__parameters:
    update_rate: 100
    joint_state_broadcaster: {{type: joint_state_broadcaster/JointStateBroadcaster}}
    arm: {{type: {TRAJECTORY}}}
    base: {{type: {TRAJECTORY}}}
    own: {{type: my_package/MyController}}
arm:
  ros__parameters: {{joints: [a, b], command_interfaces: [position], constraints: {{goal_time: 0.5}}}}
base:
  ros__parameters: {{joints: [c], command_interfaces: [velocity, position]}}
"""
FR3_CONTROLLERS = """
{0}controller_manager:
  ros__parameters:
    update_rate: 1000
    fr3_arm_controller: {{type: joint_trajectory_controller/JointTrajectoryController}}
{0}fr3_arm_controller:
  ros__parameters:
    command_interfaces: [effort]
    state_interfaces: [position, velocity]
    joints: [fr3_joint1]
    gains: {{fr3_joint1: {{p: 600., d: 30., i: 0., i_clamp: 1.}}}}
"""
MOCK = "mock_components/GenericSystem"
SIMULATED = "gz_ros2_control/GazeboSimSystem"


def tag(name: str, plugin: str, *joints: str, parameters: str = "") -> str:
    hardware = f"<hardware><plugin>{plugin}</plugin>{parameters}</hardware>"
    return f"<ros2_control name='{name}' type='system'>{hardware}{''.join(joints)}</ros2_control>"


def joint(name: str, interface: str = "position", initial: str = "0") -> str:
    state = f"<state_interface name='position'><param name='initial_value'>{initial}</param></state_interface>"
    return f"<joint name='{name}'><command_interface name='{interface}'/>{state}</joint>"


def visited(*nodes: Node) -> LaunchContext:
    context = LaunchContext()
    for node in nodes:
        node.visit(context)
    return context


def prepared(urdf: str, srdf: str = "", *, controllers: dict | None = None, **options: str) -> LaunchContext:
    """Visits a control node beside a node that has the description."""
    description = {"robot_description": urdf, **({"robot_description_semantic": srdf} if srdf else {})}
    parameters = [controllers or {}]
    control = Node(package="controller_manager", executable="ros2_control_node", parameters=parameters, **options)
    given = [description] if urdf else []
    other = Node(package="tf2_ros", executable="buffer_server", name="o", parameters=given, **options)
    context = visited(control, other)
    prepare = context.requests[0].prepare
    assert prepare is not None
    prepare(context.parameters.get)
    return context


def hardware(urdf: str, srdf: str = "", *, controllers: dict | None = None) -> dict:
    """The parameters of a control node's hardware: all but those of controllers and descriptions."""
    context = prepared(urdf, srdf, controllers=controllers)
    names = {name: value for name, value in context.parameters.values().items() if "robot_description" not in name}
    return {name: value for name, value in names.items() if not name.startswith("/arm/")}


@pytest.mark.parametrize(
    ("arguments", "positional"),
    [
        ("--frame-id world --child-frame-id base", "0 0 0 0 0 0 world base"),
        ("--x -1e-3 --z 2 --yaw 1.5 --frame-id world --child-frame-id base", "-1e-3 0 2 1.5 0 0 world base"),
        ("--qz 0.7 --qw 0.7 --frame-id world --child-frame-id base", "0 0 0 0 0 0.7 0.7 world base"),
        ("1 2 3 0 0 0 world base", "1 2 3 0 0 0 world base"),
    ],
)
def test_a_static_transform_is_written_without_names(arguments: str, positional: str) -> None:
    node = Node(package="tf2_ros", executable="static_transform_publisher", arguments=arguments.split())
    assert visited(node).requests[0].command[1:] == positional.split()


@pytest.mark.parametrize(
    ("arguments", "command"),
    [
        ("arm -c /controller_manager", "controller_manager --namespace / --no-timeout spawn arm"),
        ("a b --controller-manager /l/controller_manager", "controller_manager --namespace /l --no-timeout spawn a b"),
        ("arm --inactive --controller-manager-timeout 5", "controller_manager --namespace / --timeout 5 load arm"),
        ("arm --unload-on-kill", "spawner --namespace / --no-timeout arm"),
    ],
)  # fmt: skip
def test_a_spawner_ends_when_its_controllers_run(arguments: str, command: str) -> None:
    node = Node(package="controller_manager", executable="spawner", arguments=arguments.split())
    path, *words = visited(node).requests[0].command
    assert [Path(path).name, *words] == command.split()


def test_a_spawner_takes_type_and_parameters_of_its_controllers(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("arm: {ros__parameters: {joints: [a]}, type: x/y}")
    arguments = ["arm", "-t", "joint_state_broadcaster/JointStateBroadcaster"]
    context = visited(Node(package="controller_manager", executable="spawner", arguments=arguments))
    assert context.parameters.values() == {"/arm/type": "joint_state_controller/JointStateController"}


def test_a_spawner_takes_the_type_in_the_section_of_its_controller(tmp_path: Path) -> None:
    arm = f"{{type: {TRAJECTORY}, command_interfaces: [effort], joints: [fr3_joint1, fr3_joint2]}}"
    hand = "{type: position_controllers/GripperActionController, allow_stalling: true, joint: fr3_finger_joint1}"
    (tmp_path / "p.yaml").write_text(
        f"fr3_arm_controller:\n  ros__parameters: {arm}\n/**/gripper_action_controller:\n  ros__parameters: {hand}\n"
    )
    arguments = ["fr3_arm_controller", "gripper_action_controller", "--param-file", str(tmp_path / "p.yaml")]
    values = visited(Node(package="controller_manager", executable="spawner", arguments=arguments)).parameters.values()
    assert values["/fr3_arm_controller/type"] == "effort_controllers/JointTrajectoryController"
    assert values["/fr3_arm_controller/joints"] == ["fr3_joint1", "fr3_joint2"]
    assert values["/gripper_action_controller/type"] == "position_controllers/GripperActionController"
    assert values["/gripper_action_controller/joint"] == "fr3_finger_joint1"
    assert values["/gripper_action_controller/allow_stalling"] is True


def test_a_spawner_takes_the_parameters_of_a_controller_whose_type_is_an_argument(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("arm: {ros__parameters: {joints: [a], command_interfaces: [velocity]}}")
    arguments = ["arm", "-t", TRAJECTORY, "-p", str(tmp_path / "p.yaml")]
    values = visited(Node(package="controller_manager", executable="spawner", arguments=arguments)).parameters.values()
    assert values["/arm/type"] == "velocity_controllers/JointTrajectoryController"
    assert values["/arm/joints"] == ["a"]


@pytest.mark.parametrize("entry", ["front_wheel_joint", "{name: front_wheel_joint}"])
def test_names_of_extra_joints_are_entries_of_ros_1(tmp_path: Path, entry: str) -> None:
    (tmp_path / "p.yaml").write_text(
        "/bmx/controller_manager:\n  ros__parameters:\n"
        "    joint_state_broadcaster: {type: joint_state_broadcaster/JointStateBroadcaster}\n"
        "/bmx/joint_state_broadcaster:\n"
        f"  ros__parameters: {{use_local_topics: false, extra_joints: [{entry}], frame_id: base_footprint}}\n"
    )
    options = {"namespace": "bmx", "parameters": [str(tmp_path / "p.yaml")]}
    values = visited(Node(package="controller_manager", executable="ros2_control_node", **options)).parameters.values()
    assert values["/bmx/joint_state_broadcaster/extra_joints"] == [{"name": "front_wheel_joint"}]


def test_rviz_brings_the_marker_for_goals_only_with_moveit() -> None:
    moveit = {"robot_description_semantic": "<robot name='a'/>"}
    rviz = visited(
        Node(package="rviz2", executable="rviz2", name="rviz2", arguments=["-d", "a.rviz"], parameters=[moveit])
    )
    assert [Path(request.command[0]).name for request in rviz.requests] == ["rviz", "interactive_goal"]
    assert rviz.requests[0].command[1:] == ["-d", "a.rviz", "__name:=rviz2"]
    assert len(visited(Node(package="rviz2", executable="rviz2")).requests) == 1


def test_controllers_of_a_file_of_ros_2_are_those_of_ros_1(tmp_path: Path) -> None:
    (tmp_path / "ros2_controllers.yaml").write_text(CONTROLLERS)
    path = str(tmp_path / "ros2_controllers.yaml")
    context = visited(Node(package="controller_manager", executable="ros2_control_node", parameters=[path]))
    values = context.parameters.values()
    assert values["/controller_manager/rate"] == 100.0
    assert values["/joint_state_broadcaster/type"] == "joint_state_controller/JointStateController"
    assert values["/arm/type"] == "position_controllers/JointTrajectoryController"
    assert values["/base/type"] == "pos_vel_controllers/JointTrajectoryController"
    assert values["/own/type"] == "my_package/MyController"
    assert (values["/arm/joints"], values["/arm/constraints/goal_time"]) == (["a", "b"], 0.5)
    assert not any(name.startswith("/controller_manager/arm") for name in values)


@pytest.mark.parametrize("constraints", ["{}", "{goal_time: 0.0, stopped_velocity_tolerance: 0.02, a: {goal: 0.03}}"])
def test_a_goal_of_ros_2_without_goal_time_has_no_time_limit(tmp_path: Path, constraints: str) -> None:
    (tmp_path / "ros2_controllers.yaml").write_text(
        f"""
controller_manager:
  ros__parameters:
    arm: {{type: {TRAJECTORY}}}
arm:
  ros__parameters:
    joints: [a]
    command_interfaces: [effort]
    state_interfaces: [position, velocity]
    open_loop_control: true
    constraints: {constraints}
    gains: {{a: {{p: 10.0, d: 1.0, ff_velocity_scale: 0.5}}}}
"""
    )
    path = str(tmp_path / "ros2_controllers.yaml")
    context = visited(Node(package="controller_manager", executable="ros2_control_node", parameters=[path]))
    values = context.parameters.values()
    assert values["/arm/constraints/goal_time"] == 1e9
    assert not [name for name in values if "interfaces" in name or "open_loop" in name]  # a warning in ROS 1
    assert values.get("/arm/constraints/stopped_velocity_tolerance", 0.02) == 0.02
    assert values.get("/arm/constraints/a/goal", 0.03) == 0.03
    assert (values["/arm/gains/a/p"], values["/arm/gains/a/d"], values["/arm/velocity_ff/a"]) == (10.0, 1.0, 0.5)


@pytest.mark.parametrize("namespace", ["", "/left"])
@pytest.mark.parametrize(
    "file", [FR3_CONTROLLERS.format("/**/"), "/**:" + indent(FR3_CONTROLLERS.format(""), "  ")], ids=["flat", "nested"]
)
def test_sections_of_any_namespace_are_those_of_the_controllers(tmp_path: Path, file: str, namespace: str) -> None:
    (tmp_path / "controllers.yaml").write_text(file)
    options = {"namespace": namespace, "parameters": [str(tmp_path / "controllers.yaml")]}
    values = visited(Node(package="controller_manager", executable="ros2_control_node", **options)).parameters.values()
    assert values[f"{namespace}/controller_manager/rate"] == 1000.0
    arm = f"{namespace}/fr3_arm_controller"
    assert values[f"{arm}/type"] == "effort_controllers/JointTrajectoryController"
    assert values[f"{arm}/joints"] == ["fr3_joint1"]
    assert values[f"{arm}/gains/fr3_joint1/p"] == 600.0


def test_an_interpolation_that_ros_1_lacks_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "ros2_controllers.yaml").write_text(
        CONTROLLERS.replace("[position],", "[position], interpolation_method: none,").replace(
            "[velocity, position]", "[velocity, position], interpolation_method: splines"
        )
    )
    path = str(tmp_path / "ros2_controllers.yaml")
    context = visited(Node(package="controller_manager", executable="ros2_control_node", parameters=[path]))
    assert not [name for name in context.parameters.values() if "interpolation" in name]
    (line,) = [each for each in capsys.readouterr().out.splitlines() if "interpolation_method" in each]
    assert "controller arm: interpolation_method none has no effect" in line


@pytest.mark.parametrize(
    ("parameter", "warning"),
    [
        ("allow_nonzero_velocity_at_trajectory_end: true", ""),
        (
            "allow_nonzero_velocity_at_trajectory_end: false",
            "allow_nonzero_velocity_at_trajectory_end False has no effect",
        ),
        ("allow_integration_in_goal_trajectories: true", "ROS 1 always has False"),
        ("cmd_timeout: 0.0", ""),
        ("cmd_timeout: 2.0", "cmd_timeout 2.0 has no effect"),
        ("set_last_command_interface_value_as_state_on_activation: true", ""),
        ("command_joints: []", ""),
        ("command_joints: [b]", "command_joints ['b'] has no effect"),
        ("gains: {a: {angle_wraparound: true}}", ""),
    ],
)
def test_a_trajectory_parameter_of_ros_2_is_dropped_and_named_if_ros_1_does_otherwise(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], parameter: str, warning: str
) -> None:
    path = tmp_path / "ros2_controllers.yaml"
    path.write_text(CONTROLLERS.replace("[position],", f"[position], {parameter},"))
    context = visited(Node(package="controller_manager", executable="ros2_control_node", parameters=[str(path)]))
    name = parameter.partition(":")[0] if "angle" not in parameter else "angle_wraparound"
    assert not [each for each in context.parameters.values() if name in each]
    warnings = [line for line in capsys.readouterr().out.splitlines() if "has no effect" in line]
    assert len(warnings) == bool(warning) and all(warning in line and "controller arm" in line for line in warnings)


def test_a_velocity_that_no_state_interface_gives_is_not_checked(tmp_path: Path) -> None:
    (tmp_path / "ros2_controllers.yaml").write_text(
        CONTROLLERS.replace("[position],", "[position], state_interfaces: [position],")
    )
    path = str(tmp_path / "ros2_controllers.yaml")
    context = visited(Node(package="controller_manager", executable="ros2_control_node", parameters=[path]))
    assert context.parameters.values()["/arm/constraints/stopped_velocity_tolerance"] == 0.0


def test_controllers_of_a_file_of_ros_1_stay_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "controllers.yaml").write_text(
        "arm: {type: position_controllers/JointTrajectoryController, joints: [a]}"
    )
    path = str(tmp_path / "controllers.yaml")
    context = visited(Node(package="controller_manager", executable="ros2_control_node", parameters=[path]))
    assert context.parameters.values() == {
        "/arm/type": "position_controllers/JointTrajectoryController",
        "/arm/joints": ["a"],
    }


def test_the_hardware_is_what_the_description_names() -> None:
    arm = tag("arm-1", MOCK, joint("a", initial="0.5"), joint("b"))
    assert hardware(f"<robot name='r'>{arm}</robot>") == {
        "/controller_manager/type": "modular_framework_control/MockRobotHW",
        "/controller_manager/joints": ["a", "b"],
        "/controller_manager/initial_positions/a": 0.5,
        "/controller_manager/initial_positions/b": 0.0,
        "/controller_manager/command_interface": "PositionJointInterface",
    }
    real = tag(
        "hand", "drivers/Hand", joint("c"), parameters="<param name='port'>/dev/x</param><param name='id'>3</param>"
    )
    both = hardware(f"<robot name='r'>{arm}{real}</robot>")
    assert both["/robot_hardware"] == ["arm_1", "hand"]
    assert (both["/hand/type"], both["/hand/port"], both["/hand/id"]) == ("drivers/Hand", "/dev/x", 3)
    assert both["/arm_1/joints"] == ["a", "b"]


def test_mock_hardware_is_one_for_each_kind_of_command() -> None:
    mixed = tag("arm", MOCK, joint("a"), joint("wheel", "velocity"))
    parameters = hardware(f"<robot name='r'>{mixed}</robot>")
    assert parameters["/robot_hardware"] == ["arm_position", "arm_velocity"]
    assert parameters["/arm_velocity/command_interface"] == "VelocityJointInterface"


@pytest.mark.parametrize("plugin", [SIMULATED, "ign_ros2_control/IgnitionSystem", "gazebo_ros2_control/GazeboSystem"])
def test_simulated_hardware_starts_the_simulation_which_is_the_clock_of_all_nodes(plugin: str) -> None:
    arm = tag("arm", plugin, joint("a"), parameters="<param name='gui'>true</param>")
    controllers = {"arm": {"type": "position_controllers/JointTrajectoryController", "joints": ["a"]}}
    context = prepared(f"<robot name='r'>{arm}</robot>", controllers=controllers)
    path, *words = context.requests[0].command
    assert Path(path).parts[-2:] == ("modular_framework_simulation", "simulation")
    assert words == ["__name:=controller_manager"]
    values = context.parameters.values()
    assert (values["/use_sim_time"], values["/controller_manager/gui"]) == (True, True)
    assert values["/arm/type"] == "position_controllers/JointTrajectoryController"
    assert "/controller_manager/type" not in values and "/robot_hardware" not in values


def test_simulated_hardware_stands_alone_in_the_namespace_of_the_simulation() -> None:
    arm, hand = tag("arm", SIMULATED, joint("a")), tag("hand", MOCK, joint("b"))
    with pytest.raises(
        RuntimeError, match="name='hand'> is mock_components.* beside simulated hardware; allowed: only"
    ):
        prepared(f"<robot name='r'>{arm}{hand}</robot>")
    with pytest.raises(RuntimeError, match="in namespace /left has simulated hardware; allowed: namespace /"):
        prepared(f"<robot name='r'>{arm}</robot>", namespace="left")


def test_without_a_tag_all_joints_are_mock_and_begin_in_a_named_state() -> None:
    links = "".join(f"<link name='{name}'/>" for name in "wxyz")
    limit = "<limit lower='{}' upper='3' effort='1' velocity='1'/>"
    joints = "".join(
        f"<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/>"
        f"<axis xyz='0 0 1'/>{limit.format(lower)}{mimic}</joint>"
        for name, parent, child, lower, mimic in (
            ("a", "w", "x", "-3", ""),
            ("b", "x", "y", "1.5", ""),
            ("c", "y", "z", "-3", "<mimic joint='a'/>"),
        )
    )
    srdf = (
        "<robot name='r'><group name='g'><joint name='a'/></group>"
        "<group_state name='home' group='g'><joint name='a' value='0.7'/></group_state></robot>"
    )
    parameters = hardware(f"<robot name='r'>{links}{joints}</robot>", srdf)
    assert parameters["/controller_manager/joints"] == ["a", "b"]
    assert parameters["/controller_manager/initial_positions/a"] == 0.7
    assert parameters["/controller_manager/initial_positions/b"] == 1.5  # 0 is outside of its limits


def test_without_a_description_the_joints_are_those_of_the_controllers() -> None:
    arm = {"type": "position_controllers/JointTrajectoryController", "joints": ["a", "b"]}
    assert hardware("", controllers={"arm": arm})["/controller_manager/joints"] == ["a", "b"]


@pytest.mark.parametrize(
    ("urdf", "message"),
    [
        ("<robot", "not an XML document"),
        (f"<robot>{tag('arm', '')}</robot>", "name='arm'> has no <hardware><plugin>"),
        (f"<robot>{tag('arm', MOCK, joint('a', 'torque'))}</robot>", r"'a' has the command interfaces \['torque'\]"),
        (f"<robot>{tag('arm', MOCK, joint('a', initial='x'))}</robot>", "initial value of joint 'a' is 'x'"),
        ("", "the hardware is unknown"),
    ],
)
def test_hardware_that_cannot_be_understood_is_refused(urdf: str, message: str) -> None:
    with pytest.raises(RuntimeError, match=message):
        hardware(urdf)


@pytest.mark.parametrize(
    ("node", "message"),
    [
        ({"executable": "spawner", "arguments": ["-c", "/controller_manager"]}, "spawner: .*controller_names"),
        ({"executable": "spawner", "arguments": ["arm", "--wrong"]}, "unrecognized arguments: --wrong"),
        ({"package": "tf2_ros", "executable": "static_transform_publisher", "arguments": ["--x", "1"]}, "--frame-id"),
        (
            {
                "package": "tf2_ros",
                "executable": "static_transform_publisher",
                "arguments": "--yaw 1 --qx 1 --frame-id a --child-frame-id b".split(),
            },
            "angles and a quaternion",
        ),
    ],
)
def test_arguments_that_the_program_of_ros_2_has_not_are_refused(node: dict, message: str) -> None:
    with pytest.raises(RuntimeError, match=message):
        visited(Node(**{"package": "controller_manager", **node}))
