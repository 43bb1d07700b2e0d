# SPDX-License-Identifier: BSD-3-Clause
"""Runs launch descriptions in this process, and launch files with the command, on a master of their own."""

import os
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
from launch import LaunchDescription, LaunchService
from launch.actions import OpaqueFunction, SetLaunchConfiguration

from modular_framework_core.launching.launch_session import free_port

COMMAND = Path(__file__).parents[3] / "src" / "compat" / "launch" / "scripts" / "launch_py"


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str]]:
    """Runs entities that start no process; answers exit code and what the launch said."""

    def run_entities(entities: Iterable, **given: str) -> tuple[int, str]:
        service = LaunchService()
        settings = [SetLaunchConfiguration(name, value) for name, value in given.items()]
        service.include_launch_description(LaunchDescription([*settings, *entities]))
        code = service.run()
        return code, capsys.readouterr().out

    return run_entities


@pytest.fixture
def seen() -> list[str]:
    """What `note` has written."""
    return []


@pytest.fixture
def note(seen: list[str]) -> Callable[..., OpaqueFunction]:
    """Makes an action that writes the text of a substitution into `seen`."""

    def make(substitution) -> OpaqueFunction:
        return OpaqueFunction(function=lambda context: seen.append(substitution.perform(context)))

    return make


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """Environment with a master and log folder of its own."""
    return {
        **os.environ,
        "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(tmp_path / "ros_home"),
        "ROS_LOG_DIR": str(tmp_path / "log"),
    }


@pytest.fixture
def launch_file(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a Python launch file; its text is the list of entities, and functions before it."""

    def write(entities: str, before: str = "", name: str = "some.launch.py") -> Path:
        path = tmp_path / name
        path.write_text(
            "from launch import *\nfrom launch.actions import *\nfrom launch.conditions import *\n"
            "from launch.event_handlers import *\nfrom launch.substitutions import *\n"
            "from launch.launch_description_sources import *\nfrom launch_ros.actions import *\n"
            f"from launch_ros.substitutions import *\n{before}\n"
            f"def generate_launch_description():\n    return LaunchDescription([\n{entities}\n    ])\n"
        )
        return path

    return write


@pytest.fixture
def launch_py(environment: dict[str, str]) -> Callable[..., subprocess.CompletedProcess]:
    """Runs the command with arguments to its end."""

    def run_command(*arguments: object) -> subprocess.CompletedProcess:
        command = ["python3", str(COMMAND), *map(str, arguments)]
        return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)

    return run_command
