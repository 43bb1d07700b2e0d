# SPDX-License-Identifier: BSD-3-Clause
"""Elements of launch files: a bool argument, and a node with a debugging mode."""

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
    """Declares a launch argument with the values true and false.

    Args:
        name: Name of the argument.
        default_value: Default value.
        description: Description of the argument.
    """

    def __init__(self, name: str, *, default_value: Any = False, description: str | None = None, **kwargs: Any) -> None:
        super().__init__(name, default_value=str(default_value), description=description, choices=BOOLEANS, **kwargs)


class DeclareRefusedLaunchArg(DeclareLaunchArgument):
    """Declares a launch argument of MoveIt 2 that must be false, because true is not supported.

    Args:
        name: Name of the argument.
        reason: Reason, and the alternative.
    """

    def __init__(self, name: str, *, reason: str) -> None:
        super().__init__(
            name, default_value="false", description=f"Not supported: {reason}", choices=["false", "False"]
        )


def add_debuggable_node(
    ld: LaunchDescription,
    package: str,
    executable: str,
    condition_name: str = "debug",
    commands_file: str | None = None,
    extra_debug_args: Iterable[str] | None = None,
    **kwargs: Any,
) -> None:
    """Adds a node, with further arguments if a launch argument enables debugging.

    Unlike MoveIt 2, this function does not run the program in gdb, because the nodes are Python programs. For another
    program, use the launch argument `launch-prefix:="gdb -ex run --args"`.

    Args:
        ld: Launch description.
        package: Package of the program.
        executable: Name of the program.
        condition_name: Name of the launch argument.
        commands_file: Commands for gdb; not used.
        extra_debug_args: Further arguments for debugging.
        **kwargs: Arguments of Node.
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
