# SPDX-License-Identifier: BSD-3-Clause
"""Launch files start real processes on a master of their own, react to them, and end in order with an exit code."""

import signal
import subprocess
from pathlib import Path

import pytest

COMMAND = Path(__file__).parents[3] / "src" / "compat" / "launch" / "scripts" / "launch_py"
LONG = 'ExecuteProcess(cmd=["sleep", "60"])'


def test_events_of_processes_lead_from_one_to_the_next(launch_file, launch_py, tmp_path: Path) -> None:
    """Start, end, a timer, a respawn with an end, groups whose scope has ended, and what the shutdown says."""
    path = launch_file(
        before="""
first = ExecuteProcess(cmd=["sh", "-c", ["exit ", LaunchConfiguration("code")]], name="first")
second = ExecuteProcess(cmd=["echo", "second runs with", EnvironmentVariable("ARM_OF_THE_TEST")], output="screen")
restless = ExecuteProcess(cmd=["true"], name="restless", respawn=True, respawn_delay=0.1, respawn_max_retries=2)
def say(event, context):
    return [LogInfo(msg=f"first ended with {event.returncode}"), second]
def log_start(event, context):
    return LogInfo(msg=f"{event.process_name} has pid {event.pid > 0}")
""",
        entities="""
        DeclareLaunchArgument("code"),
        SetEnvironmentVariable("ARM_OF_THE_TEST", "left"),
        GroupAction([
            SetLaunchConfiguration("who", "the group"),
            RegisterEventHandler(OnProcessExit(target_action=first, on_exit=say)),
            RegisterEventHandler(OnProcessExit(target_action=second, on_exit=[
                LogInfo(msg=["second ended in ", LaunchConfiguration("who")]),
                TimerAction(period=0.3, actions=[Shutdown(reason=["enough of ", LaunchConfiguration("who")])]),
            ])),
        ]),
        RegisterEventHandler(OnProcessStart(target_action=restless, on_start=log_start)),
        RegisterEventHandler(OnShutdown(on_shutdown=LogInfo(msg=["ends: ", LocalSubstitution("event.reason")]))),
        restless,
        ExecuteProcess(cmd=["sleep", "60"]),
        TimerAction(period=1.0, actions=[first]),
""",
    )
    result = launch_py(path, "code:=7")
    assert result.returncode == 0, result.stdout + result.stderr
    said = [line.removeprefix("[INFO] [launch.user]: ") for line in result.stdout.splitlines() if "launch.user" in line]
    order = ["first ended with 7", "second ended in the group", "ends: enough of the group"]
    assert [line for line in said if "pid" not in line] == order
    assert sum("restless" in line for line in said) == 3  # once, and two retries
    assert "second runs with left" in result.stdout


@pytest.mark.parametrize(
    ("entities", "code", "said"),
    [
        (f'ExecuteProcess(cmd=["false"], name="broken", on_exit=Shutdown()), {LONG}', 3, "broken"),
        (f'ExecuteProcess(cmd=["true"], on_exit=Shutdown(reason="done")), {LONG}', 0, "done"),
        ('ExecuteProcess(cmd="exit 4", shell=True, name="broken")', 2, "cmd is a single string"),
        ('ExecuteProcess(cmd=["exit 4"], shell=True, name="broken")', 3, "everything has ended; failed: broken"),
        ('ExecuteProcess(cmd=["/no/such/program"])', 2, "/no/such/program"),
        ('ExecuteProcess(cmd=["true"], output="skreen")', 2, "did you mean 'screen'"),
        ('ExecuteProcess(cmd=["true"], respwan=True)', 2, "did you mean 'respawn'"),
        ('Node(package="tf2_rosso", executable="x")', 2, "no package 'tf2_rosso'; did you mean 'tf2_ros'"),
        ('Node(package="tf2_ros", executable="static_transform")', 2, "did you mean 'static_transform_publisher'"),
        ('Node(package="tf2_ros", executable="buffer_server", name="a"),' * 2, 2, "two nodes /a"),
        ('LogInfo(msg=PathJoinSubstitution([FindPackageShare("launch"), "launch"]))', 0, "launch/launch"),
    ],
)  # fmt: skip
def test_the_exit_code_and_the_last_words_tell_how_it_ended(
    launch_file, launch_py, entities: str, code: int, said: str
) -> None:
    path = launch_file(f"        {entities}")
    result = launch_py(path)
    assert (result.returncode, said in result.stdout) == (code, True), result.stdout + result.stderr
    if code == 2 and "/no/such" not in said:
        assert f"{path}:" in result.stdout  # with the line
        assert "started with pid" not in result.stdout


def test_ctrl_c_ends_everything_in_order(launch_file, environment, tmp_path: Path) -> None:
    ended = tmp_path / "ended"
    path = launch_file(
        f"""
        ExecuteProcess(cmd=["sh", "-c",
                            "trap 'echo yes > {ended}; exit 0' INT; echo ready; while :; do sleep 0.1; done"],
                       output="screen"),
        RegisterEventHandler(OnShutdown(on_shutdown=[LogInfo(msg="the end")])),
"""
    )
    command = ["python3", str(COMMAND), str(path)]
    launch = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
    assert launch.stdout is not None
    try:
        seen = ""
        while "ready" not in seen:
            line = launch.stdout.readline()
            assert line, seen
            seen += line
        launch.send_signal(signal.SIGINT)
        rest = launch.communicate(timeout=30)[0]
    finally:
        launch.kill()
    assert launch.returncode == 0
    assert "the end" in rest and "got SIGINT" in rest
    assert ended.read_text() == "yes\n"


def test_an_xml_file_runs_with_arguments_and_namespace(launch_file, launch_py, tmp_path: Path) -> None:
    (tmp_path / "inner.launch").write_text(
        '<launch><arg name="greeting" default="none" doc="what to say"/><arg name="must"/>'
        '<param name="said" value="$(arg greeting) $(arg must)"/>'
        '<node pkg="tf2_ros" type="static_transform_publisher" name="still" args="0 0 0 0 0 0 a b"/></launch>'
    )
    show = 'ExecuteProcess(cmd=["rosparam", "get", "/left/said"], output="screen", on_exit=Shutdown())'
    path = launch_file(
        f"""
        GroupAction([
            PushRosNamespace("left"),
            IncludeLaunchDescription(PathJoinSubstitution([ThisLaunchFileDir(), "inner.launch"]),
                                     launch_arguments={{"greeting": "hello & <you>", "must": "do"}}.items()),
        ]),
        {show},
"""
    )
    result = launch_py(path)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "hello & <you> do" in result.stdout
    assert "process[left/still-" in result.stdout
    listing = launch_py("--show-args", tmp_path / "inner.launch").stdout
    assert "'greeting':\n        what to say\n        (default: 'none')" in listing
    refused = launch_py(tmp_path / "inner.launch", "greetin:=x", "must:=y")
    assert refused.returncode == 2
    assert "has no argument 'greetin'; did you mean 'greeting'" in refused.stdout
    assert "requires the argument 'must'" in launch_py(tmp_path / "inner.launch").stdout


def test_a_required_node_of_an_xml_file_ends_the_launch(launch_py, tmp_path: Path) -> None:
    path = tmp_path / "required.launch"
    wrong = '<node pkg="tf2_ros" type="static_transform_publisher" name="wrong" args="1 2" required="true"/>'
    path.write_text(f"<launch>{wrong}</launch>")
    result = launch_py(path)
    assert result.returncode == 3, result.stdout + result.stderr
    assert "required node wrong ended" in result.stdout


def test_the_command_names_what_is_wrong_with_its_words(launch_file, launch_py, tmp_path: Path) -> None:
    path = launch_file('        DeclareLaunchArgument("arm", default_value="left"), LogInfo(msg="runs")')
    assert "runs" in launch_py(path, "arm:=right").stdout
    for words, message in (
        ((path, "amr:=right"), "has no argument 'amr'; did you mean 'arm'; allowed: arm"),
        ((path, "arm=right"), "allowed: launch_py"),
        (("ur5_ezgripper_moveit_confg", "demo.launch.py"), "did you mean 'ur5_ezgripper_moveit_config'"),
        (("ur5_ezgripper_moveit_config", "dmo.launch.py"), "did you mean 'demo.launch.py'"),
        ((tmp_path / "none.launch.py",), "does not exist"),
    ):
        result = launch_py(*words)
        assert (result.returncode, message in result.stdout) == (2, True), result.stdout + result.stderr
    broken = launch_file("        1 / 0,", name="broken.launch.py")
    assert f"{broken}:" in (said := launch_py(broken).stdout)
    assert "ZeroDivisionError" in said
    nested = launch_file(f'        IncludeLaunchDescription("{path.parent}/somme.launch.py")', name="nested.launch.py")
    assert "did you mean 'some.launch.py'" in launch_py(nested).stdout


def test_a_launch_that_starts_nothing_needs_no_master(launch_file, launch_py) -> None:
    result = launch_py(launch_file('        LogInfo(msg="nothing to start")'))
    assert (result.returncode, "master" in result.stdout) == (0, False)
