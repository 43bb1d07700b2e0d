# SPDX-License-Identifier: BSD-3-Clause
"""The services of compose.yaml are the containers that the deployer makes: same image, folders, devices and rights."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from deployer import CONTAINER_USER, DEPLOY, Deployer, add_command

FLAGS = {
    "--volume": "volumes",
    "--device": "devices",
    "--device-cgroup-rule": "device_cgroup_rules",
    "--group-add": "group_add",
    "--cap-add": "cap_add",
    "--ulimit": "ulimits",
    "--env": "environment",
    "--gpus": "gpus",
}
"""Options of docker create that may be given several times, by the compose key of the same meaning."""
SINGLE = {"--ipc": "ipc", "--hostname": "hostname"}
OWN = ("--name", "--label")  # of the deployer alone


def substituted(text: str, variables: dict[str, str]) -> str:
    """Puts variables into a text as compose does: ${NAME:-default} and ${NAME:?message}."""

    def value(match: re.Match[str]) -> str:
        name, kind, rest = match.groups()
        assert variables.get(name) or kind == "-", f"{name} {rest}"
        return variables.get(name) or rest

    return re.sub(r"\$\{(\w+):([-?])([^}]*)\}", value, text)


def of_service(service: dict[str, Any]) -> dict[str, Any]:
    """Returns what a service of a compose file gives its container."""
    assert service.pop("init") is True
    assert service.pop("pull_policy") == "never"
    service.pop("profiles")
    build = service.pop("build")
    assert build == {"context": "..", "dockerfile": "docker/Dockerfile", "args": {"USER_ID": str(CONTAINER_USER)}}
    command = service.pop("command").split()
    assert command.pop(0) == "run"
    gpus = service.pop("deploy", {}).get("resources", {}).get("reservations", {}).get("devices", [])
    assert gpus in ([], [{"driver": "nvidia", "count": "all", "capabilities": ["gpu"]}])
    for key in ("environment", "ulimits"):
        service[key] = [f"{name}={value}" for name, value in service.get(key, {}).items()]
    service["gpus"] = ["all"] * len(gpus)
    lists = {key: sorted(service.pop(key, [])) for key in FLAGS.values()}
    return {**service, **lists, "arguments": command}


def of_command(create: list[str], arguments: list[str]) -> dict[str, Any]:
    """Returns what a docker create gives its container."""
    *options, image, command = create[1:]
    assert command == "run"
    options.remove("--init")
    found: dict[str, Any] = {key: [] for key in FLAGS.values()}
    for flag, value in zip(options[::2], options[1::2], strict=True):
        if flag in FLAGS:
            found[FLAGS[flag]].append(value)
        elif flag in SINGLE:
            found[SINGLE[flag]] = value
        else:
            assert flag in OWN
    return {**{key: sorted(value) if isinstance(value, list) else value for key, value in found.items()},
            "image": image, "arguments": arguments}  # fmt: skip


@pytest.mark.parametrize(
    ("service", "nvidia", "options"),
    [
        ("headless", "false", ["headless=true"]),
        ("screen", "false", []),
        ("nvidia", "true", []),
        ("hardware", "false", ["headless=true", "device=/dev/tty", "usb=true", "real_time=true", "simulation:=false"]),
    ],
)
def test_a_service_is_the_container_that_the_deployer_makes(
    docker: Deployer, workspace: Path, service: str, nvidia: str, options: list[str]
) -> None:
    key = docker.folder / "cache" / "modular_framework" / "screen_key"
    key.parent.mkdir(parents=True)
    (docker.folder / "key").touch()
    common = {"DISPLAY": ":7", "GRAPHICS_DEVICE": "/dev/zero", "USB_FOLDER": "/dev", "LATENCY_DEVICE": "/dev/null"}
    docker.env = {**common, "XAUTHORITY": str(docker.folder / "key")}
    add_command(docker.folder / "bin", "stat", "echo 20")
    add_command(docker.folder / "bin", "uname", "echo lab-pc")
    arguments = ["container_name=mbf", f"nvidia={nvidia}", f"workspace={workspace}", *options, "rviz:=false"]
    answer = docker.run(*arguments)
    assert answer.returncode == 0, answer.stderr
    (create,) = (command for command in docker.commands() if command[0] == "create")
    launch_arguments = (docker.folder / "copied").read_text().split("\0")[:-1]

    variables = {**common, "XAUTHORITY": str(key), "WORKSPACE": str(workspace), "LAUNCH_ARGUMENTS": "rviz:=false",
                 "USER_ID": str(CONTAINER_USER), "SERIAL_DEVICE": "/dev/tty", "HOST_NAME": "lab-pc",
                 "GRAPHICS_GROUP": "20"}  # fmt: skip
    services = yaml.safe_load(substituted(DEPLOY.with_name("compose.yaml").read_text(), variables))["services"]
    assert of_service(services[service]) == of_command(create, launch_arguments)


def test_a_workspace_must_be_named() -> None:
    with pytest.raises(AssertionError, match="WORKSPACE set it to the folder"):
        substituted(DEPLOY.with_name("compose.yaml").read_text(), {})
