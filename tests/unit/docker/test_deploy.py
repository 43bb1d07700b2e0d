# SPDX-License-Identifier: BSD-3-Clause
"""The one-line deployer makes the right calls, recorded by a fake `docker` command."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from deployer import CONTAINER_USER, Deployer, add_command


def test_builds_the_image_and_runs_the_framework_when_nothing_is_there(docker: Deployer) -> None:
    docker.deploy()
    (build,) = docker.calls("build")
    assert "-t modular_framework" in build and "docker/Dockerfile" in build and f"USER_ID={CONTAINER_USER}" in build
    (create,) = docker.calls("create")
    assert "--name mbf" in create and create.endswith("modular_framework run")
    assert "--gpus" not in create and "DISPLAY" not in create and "--volume" not in create and "--device" not in create
    assert docker.commands()[-1] == ["start", "--attach", "mbf"]


def test_does_not_build_an_image_that_is_there(docker: Deployer) -> None:
    docker.deploy()
    docker.forget_calls()
    assert docker.run("container_name=another", "nvidia=false").returncode == 0
    assert not docker.calls("build") and not docker.calls("pull") and docker.calls("start --attach another")


def test_starts_an_existing_container_again(docker: Deployer) -> None:
    docker.deploy()
    docker.forget_calls()
    docker.deploy()
    assert docker.calls("start") == ["start --attach mbf"]
    assert not docker.calls("create") and not docker.calls("build") and not docker.calls("cp")


def test_hands_over_the_gpu_only_when_asked(docker: Deployer) -> None:
    assert docker.run("container_name=mbf", "nvidia=true").returncode == 0
    assert "--gpus all" in docker.calls("create")[0]
    assert docker.calls("image rm") == ["image rm sha256:empty"], "the image of the check is gone"


@pytest.mark.parametrize(
    ("driver", "missing"),
    [("/no/driver", "no Nvidia driver is loaded"), ("/dev/null", "toolkit is missing or not in use")],
)
def test_a_gpu_that_docker_cannot_hand_over_is_refused_before_the_build(
    docker: Deployer, driver: str, missing: str
) -> None:
    docker.env = {"NVIDIA_DRIVER": driver}
    (docker.folder / "no_gpu").touch()
    answer = docker.run("container_name=mbf", "nvidia=true")
    assert answer.returncode == 1 and missing in answer.stderr and "give nvidia=false" in answer.stderr
    assert not docker.calls("build") and not docker.calls("create")


def test_the_driver_may_be_that_of_windows(docker: Deployer) -> None:
    docker.env = {"NVIDIA_DRIVER": "/no/driver", "WSL_DRIVER": "/dev/null"}
    assert docker.run("container_name=mbf", "nvidia=true").returncode == 0


def test_an_argument_of_the_launch_file_with_one_sign_is_named_as_such(docker: Deployer) -> None:
    assert "give gui:=true" in docker.refusal("gui=true")


def test_hands_over_the_screen_and_a_copy_of_its_key(docker: Deployer, tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_text("first login")
    docker.env = {"DISPLAY": ":7", "XAUTHORITY": str(key)}
    docker.deploy()
    (create,) = docker.calls("create")
    copy = tmp_path / "cache" / "modular_framework" / "screen_key"
    assert "DISPLAY=:7" in create and "/tmp/.X11-unix" in create and f"{copy}:/home/user/.Xauthority:ro" in create
    assert f"--hostname {os.uname().nodename}" in create
    assert copy.read_text() == "first login" and copy.stat().st_mode & 0o777 == 0o600
    inode = copy.stat().st_ino
    key.write_text("second login")
    docker.deploy()
    assert copy.read_text() == "second login" and copy.stat().st_ino == inode, "the mounted file itself is written"


def test_headless_hands_over_no_screen(docker: Deployer) -> None:
    docker.env = {"DISPLAY": ":7", "GRAPHICS_DEVICE": "/dev/tty"}
    docker.deploy("headless=true")
    (create,) = docker.calls("create")
    assert "DISPLAY" not in create and "X11" not in create and "/dev/tty" not in create


def test_the_graphics_device_goes_with_the_screen(docker: Deployer) -> None:
    docker.env = {"DISPLAY": ":7", "GRAPHICS_DEVICE": "/dev/tty"}
    add_command(docker.folder / "bin", "stat", "echo 44")
    docker.deploy()
    assert "--device /dev/tty --group-add 44" in docker.calls("create")[0]


def test_an_image_is_pulled_instead_of_built_and_only_once(docker: Deployer) -> None:
    docker.deploy("image=lab/framework:2")
    assert docker.calls("pull") == ["pull lab/framework:2"] and not docker.calls("build")
    assert docker.calls("create")[0].endswith("lab/framework:2 run")
    assert docker.run("container_name=another", "nvidia=false", "image=lab/framework:2").returncode == 0
    assert len(docker.calls("pull")) == 1


def test_says_that_an_image_cannot_be_pulled(docker: Deployer) -> None:
    assert "'lab/missing' is not here and cannot be pulled" in docker.refusal("image=lab/missing")
    assert not docker.calls("create")


def test_reinstall_builds_anew_then_replaces_the_container_and_the_old_image(docker: Deployer) -> None:
    docker.deploy()
    docker.forget_calls()
    docker.deploy("reinstall=true")
    verbs = [command[0] for command in docker.commands() if command[0] in ("build", "rm", "create", "start")]
    assert verbs == ["build", "rm", "create", "start"]
    assert docker.calls("image rm") == ["image rm sha256:1"]


def test_reinstall_pulls_anew_and_works_without_a_container(docker: Deployer) -> None:
    docker.deploy("image=lab/framework", "reinstall=true")
    assert docker.calls("pull") and not docker.calls("rm") and not docker.calls("image rm") and docker.calls("start")


def test_reinstall_leaves_a_running_container_alone(docker: Deployer) -> None:
    docker.deploy()
    docker.set_running()
    docker.forget_calls()
    error = docker.refusal("reinstall=true")
    assert "'mbf' is running" in error and "docker stop mbf" in error
    assert not docker.calls("build") and not docker.calls("rm")


@pytest.mark.parametrize("option", ["reinstall=true", "reinstall=false"])
def test_leaves_a_container_alone_that_it_did_not_make(docker: Deployer, option: str) -> None:
    (docker.folder / "container.json").write_text('{"labels": {"some.other": "tool"}}')
    assert "a container 'mbf' that this script did not make" in docker.refusal(option)
    assert not docker.calls("rm") and not docker.calls("start") and not docker.calls("build")


def test_hands_launch_arguments_on_and_replaces_those_of_an_existing_container(docker: Deployer) -> None:
    docker.deploy("rviz:=false", "simulation_starting_pose:=-J a 1 -J b 2")
    assert docker.calls("cp")[0].endswith(" mbf:/home/user/.launch_arguments")
    assert (docker.folder / "copied").read_bytes() == b"rviz:=false\0simulation_starting_pose:=-J a 1 -J b 2\0"
    docker.forget_calls()
    docker.deploy("world_file:=ur5_table.world")
    assert (docker.folder / "copied").read_bytes() == b"world_file:=ur5_table.world\0"
    assert [command[0] for command in docker.commands()][-2:] == ["cp", "start"] and not docker.calls("create")


def test_refuses_launch_arguments_for_a_running_container(docker: Deployer) -> None:
    docker.deploy()
    docker.set_running()
    docker.forget_calls()
    assert "launch arguments cannot be changed" in docker.refusal("rviz:=false")
    assert not docker.calls("cp") and not docker.calls("start")


def test_a_workspace_is_mounted_for_an_image_of_its_owner(docker: Deployer, workspace: Path) -> None:
    docker.deploy(f"workspace={workspace}")
    assert f"--volume {workspace}:/workspace" in docker.calls("create")[0]


def test_a_workspace_is_refused_for_an_image_of_another_user(docker: Deployer, workspace: Path) -> None:
    docker.env = {"USER_OF_PULLED_IMAGE": "4711"}
    error = docker.refusal(f"workspace={workspace}", "image=lab/framework")
    assert f"writes as user '4711', the workspace belongs to user {CONTAINER_USER}" in error
    assert not docker.calls("create")


def test_a_workspace_of_another_user_is_refused(docker: Deployer) -> None:
    assert f"does not belong to user {CONTAINER_USER}" in docker.refusal("workspace=/opt")  # of root


def test_devices_come_with_the_groups_that_may_use_them(docker: Deployer) -> None:
    add_command(docker.folder / "bin", "stat", "case $* in *zero) echo 0 ;; *) echo 20 ;; esac")
    docker.deploy("device=/dev/null", "device=/dev/tty", "device=/dev/zero")
    (create,) = docker.calls("create")
    assert "--device /dev/null --group-add 20 --device /dev/tty --device /dev/zero" in create
    assert create.count("--group-add") == 1, "once for two devices, and not for those of root"


def test_usb_devices_are_handed_over_with_those_plugged_in_later(docker: Deployer, tmp_path: Path) -> None:
    docker.env = {"USB_FOLDER": str(tmp_path)}
    docker.deploy("usb=true")
    assert f"--volume {tmp_path}:/dev/bus/usb --device-cgroup-rule c 189:* rmw" in docker.calls("create")[0]


def test_real_time_allows_what_the_control_loop_asks_for(docker: Deployer) -> None:
    docker.env = {"LATENCY_DEVICE": "/dev/null"}
    docker.deploy("real_time=true")
    allowed = "--cap-add SYS_NICE --ulimit rtprio=80 --ulimit memlock=-1 --device /dev/null:/dev/cpu_dma_latency"
    assert allowed in docker.calls("create")[0]


def test_options_that_a_container_cannot_change_are_refused_with_what_it_has(docker: Deployer, workspace: Path) -> None:
    docker.deploy("device=/dev/null")
    docker.forget_calls()
    assert "exists already, with workspace=''" in docker.refusal(f"workspace={workspace}")
    assert "exists already, with device='/dev/null'" in docker.refusal("device=/dev/tty")
    error = docker.refusal("real_time=true")
    assert "exists already, with real_time='false'" in error and "reinstall=true" in error
    assert not docker.calls("start")
    docker.deploy("device=/dev/null", "headless=true")
    assert docker.calls("start")


def test_a_workspace_may_be_given_by_a_relative_path_or_the_home_folder(docker: Deployer, workspace: Path) -> None:
    docker.deploy("workspace=~/lab")  # not expanded: as from a shell that leaves it
    docker.deploy(f"workspace={os.path.relpath(workspace)}")
    assert f"--volume {workspace}:/workspace" in docker.calls("create")[0] and len(docker.calls("start")) == 2


REFUSED = {
    "workpace=/x": "unknown option 'workpace'; allowed: container_name, nvidia, image, workspace",
    "realtime=true": "did you mean 'real_time'?",
    "red": "unknown argument 'red'",
    "usb=ture": "usb is 'ture'; allowed: true, false\n  what to do: give usb=true",
    "real_time=1": "real_time is '1'; allowed: true, false",
    "headless=": "headless is ''; allowed: true, false",
    "headless=false": "there is no display",
    "reinstall=yes": "reinstall is 'yes'; allowed: true, false",
    "install_engine=true": "allowed: ask, yes, no",
    "image=My Image": "image is 'My Image'",
    "image=": "image is ''",
    "nvidia=false": "nvidia is given twice",
    "workspace=/no/such": "'/no/such' is not a folder",
    "device=ttyUSB0": "device is 'ttyUSB0'; allowed: a path in /dev",
    "device=/dev/nothing": "there is no device '/dev/nothing'; serial devices here",
    "wold_file:=a": "no argument 'wold_file'\n  what to do: did you mean 'world_file'?",
}
"""What an error says, by the argument that is wrong."""


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ((), "container_name= is missing"),
        (("container_name=mbf",), "nvidia= is missing"),
        (("container_name=", "nvidia=true"), "container_name is ''"),
        (("container_name=mbf", "nvidia=yes"), "nvidia is 'yes'; allowed: true, false"),
        (("container_name=a b", "nvidia=true"), "container_name is 'a b'"),
        *((("container_name=mbf", "nvidia=true", argument), named) for argument, named in REFUSED.items()),
    ],
)
def test_refuses_wrong_arguments_before_any_docker_call(
    docker: Deployer, arguments: tuple[str, ...], named: str
) -> None:
    answer = docker.run(*arguments)
    assert answer.returncode == 1 and named in answer.stderr and "what to do" in answer.stderr
    assert not docker.record.exists()


def test_help_names_every_option(docker: Deployer) -> None:
    answer = docker.run("--help")
    assert answer.returncode == 0 and not docker.record.exists()
    unknown = docker.refusal("x=1").split("allowed: ")[1].split("\n")[0]
    assert unknown.count(",") >= 9
    assert all(f"  {name}=" in answer.stdout for name in unknown.split(", "))


def test_says_that_the_engine_does_not_answer(docker: Deployer) -> None:
    (docker.folder / "off").touch()
    error = docker.refusal()
    assert "engine does not answer" in error and "group docker" in error


def test_ends_with_the_exit_code_of_the_container(docker: Deployer) -> None:
    (docker.folder / "exit_code").write_text("3")
    assert docker.run("container_name=mbf", "nvidia=false").returncode == 3
