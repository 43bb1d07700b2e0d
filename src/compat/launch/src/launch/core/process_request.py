# SPDX-License-Identifier: BSD-3-Clause
"""Processes to start, collected while the description is visited and started after its parameters are set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from launch.core.parameter_plan import Lookup


@dataclass(eq=False)
class ProcessRequest:
    """Request to start a process.

    Attributes:
        action: Action that requested the process; None for a node of an XML launch file.
        name: Name in messages; for a node, its full name without the leading slash.
        command: Program and arguments.
        environment: Environment variables.
        cwd: Working folder; empty for the folder of the launch.
        on_screen: Whether the output is printed on the screen instead of a log file.
        respawn: Whether the process restarts after its exit.
        respawn_delay_s: Delay of the restart [s].
        respawn_max_retries: Maximum number of restarts; -1 for no limit.
        sigterm_timeout_s: Time from SIGINT to SIGTERM [s].
        sigkill_timeout_s: Time from SIGTERM to SIGKILL [s].
        node_name: Full name of the node; empty for a process that is not a node or sets its own name.
        is_node: Whether the process supports `__log:=`.
        prepare: Function that is called with a parameter lookup before the parameters are set, and may plan further
            parameters.
        roslaunch_node: Node object of roslaunch for a node of an XML launch file; only `name` and `node_name` apply.
    """

    action: Any
    name: str
    command: list[str]
    environment: dict[str, str] = field(default_factory=dict)
    cwd: str = ""
    on_screen: bool = False
    respawn: bool = False
    respawn_delay_s: float = 0.0
    respawn_max_retries: int = -1
    sigterm_timeout_s: float = 15.0
    sigkill_timeout_s: float = 5.0
    node_name: str = ""
    is_node: bool = False
    prepare: Callable[[Lookup], None] | None = None
    roslaunch_node: Any = None
