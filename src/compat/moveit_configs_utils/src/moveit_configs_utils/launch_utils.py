# SPDX-License-Identifier: BSD-3-Clause
"""Parts of launch files: an argument that is true or false, and a node with a mode for debugging."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

BOOLEANS = ("true", "false", "True", "False")


class DeclareBooleanLaunchArg(DeclareLaunchArgument):
    """A launch argument that is true or false.

    Args:
        name: Its name.
        default_value: Its value when none is given.
        description: What it is for.
    """

    def __init__(self, name: str, *, default_value: Any = False, description: str | None = None, **kwargs: Any) -> None:
        super().__init__(name, default_value=str(default_value), description=description, choices=BOOLEANS, **kwargs)


class DeclareRefusedLaunchArg(DeclareLaunchArgument):
    """A launch argument of MoveIt 2 that can only be false here.

    Args:
        name: Its name.
        reason: Why, and what to use instead.
    """

    def __init__(self, name: str, *, reason: str) -> None:
        super().__init__(name, default_value="false", description=f"Not offered: {reason}", choices=["false", "False"])


def add_debuggable_node(
    ld: LaunchDescription,
    package: str,
    executable: str,
    condition_name: str = "debug",
    commands_file: str | None = None,
    extra_debug_args: Iterable[str] | None = None,
    **kwargs: Any,
) -> None:
    """Adds a node; when a launch argument says so, with further arguments for debugging.

    There is no gdb, which MoveIt 2 puts before the program: the nodes here are Python programs. For another program
    give the launch file `launch-prefix:="gdb -ex run --args"`.

    Args:
        ld: The description.
        package: Package of the program.
        executable: The program.
        condition_name: Name of the launch argument.
        commands_file: Commands of gdb; not used.
        extra_debug_args: The further arguments.
        **kwargs: Of Node.
    """
    del commands_file
    ld.add_action(
        Node(
            package=package,
            executable=executable,
            condition=UnlessCondition(LaunchConfiguration(condition_name)),
            **kwargs,
        )
    )
    arguments = [*kwargs.pop("arguments", ()), *(extra_debug_args or ())]
    ld.add_action(
        Node(
            package=package,
            executable=executable,
            condition=IfCondition(LaunchConfiguration(condition_name)),
            arguments=arguments,
            **kwargs,
        )
    )
