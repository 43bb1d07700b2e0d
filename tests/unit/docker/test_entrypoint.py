# SPDX-License-Identifier: BSD-3-Clause
"""What a container runs: the launch arguments it keeps, and what is in the workspace."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from deployer import DEPLOY, add_command


class Container:
    """A copy of the entry point whose install.sh prints its arguments, one a line, and ROS_HOME."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "checkout"
        self.workspace = folder / "workspace"
        self.home = folder / "home"
        for made in (self.root / "docker", self.root / "src", self.home):
            made.mkdir(parents=True)
        shutil.copy(DEPLOY.with_name("entrypoint"), self.root / "docker")
        add_command(self.root, "install.sh", 'printf "%s\\n" "$@"; echo "ROS_HOME=${ROS_HOME:-}"')

    def run(self, *arguments: str) -> list[str]:
        env = {**os.environ, "HOME": str(self.home), "WORKSPACE_FOLDER": str(self.workspace)}
        env.pop("ROS_HOME", None)
        answer = subprocess.run([str(self.root / "docker" / "entrypoint"), *arguments], env=env, capture_output=True,
                                text=True, check=True)  # fmt: skip
        return [line for line in answer.stdout.splitlines() if not line.startswith("Launch arguments")]

    def keep(self, *arguments: str) -> None:
        """Leaves launch arguments as the deployer does."""
        (self.home / ".launch_arguments").write_bytes(b"".join(argument.encode() + b"\0" for argument in arguments))


@pytest.fixture
def container(tmp_path: Path) -> Container:
    return Container(tmp_path)


def test_runs_the_framework_without_arguments(container: Container) -> None:
    assert container.run("run") == ["run", "ROS_HOME="]
    assert container.run() == ["run", "ROS_HOME="]


def test_hands_other_commands_on_as_they_are(container: Container) -> None:
    container.keep("rviz:=false")
    assert container.run("exec", "rosnode", "list") == ["exec", "rosnode", "list", "ROS_HOME="]


def test_runs_with_the_arguments_that_were_left_unless_others_are_given(container: Container) -> None:
    container.keep("rviz:=false", "simulation_starting_pose:=-J a 1\n-J b 2")
    assert container.run("run")[:-1] == ["run", "rviz:=false", "simulation_starting_pose:=-J a 1", "-J b 2"]
    assert container.run("run", "gui:=false")[:-1] == ["run", "gui:=false"]


def test_results_are_written_to_the_workspace(container: Container) -> None:
    container.workspace.mkdir()
    assert container.run("run")[-1] == f"ROS_HOME={container.workspace}/results"
    assert (container.workspace / "results").is_dir()


def test_the_configuration_states_and_tasks_of_the_workspace_are_used(container: Container) -> None:
    for name in ("config", "states", "tasks"):
        (container.workspace / name).mkdir(parents=True)
    task = container.workspace / "tasks" / "stack.yaml"
    task.touch()
    container.keep("task_constructor_script:=stack.yaml")
    used = [f"config_directory:={container.workspace}/config", f"states_directory:={container.workspace}/states"]
    assert container.run("run")[1:-1] == [f"task_constructor_script:={task}", *used]
    given = ["task_constructor_script:=simulation_pick.yaml", "config_directory:=/other", "states_directory:=/mine"]
    assert container.run("run", *given)[1:-1] == given, "what is given, or is not in the workspace, stays"


def test_packages_of_the_workspace_are_among_the_sources(container: Container) -> None:
    (container.workspace / "src" / "my_method").mkdir(parents=True)
    container.run("run")
    assert (container.root / "src" / "workspace" / "my_method").is_dir()
    shutil.rmtree(container.workspace)
    container.run("run")
    assert not (container.root / "src" / "workspace").is_symlink()
