# SPDX-License-Identifier: BSD-3-Clause
"""What is to be started: collected while the description is visited, started when its parameters are set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from launch.core.parameter_plan import Lookup


@dataclass(eq=False)
class ProcessRequest:
    """A process to start.

    Attributes:
        action: The action that asked for it; None for a node of an XML launch file.
        name: Name in messages; a node's full name without the first slash.
        command: Program and arguments.
        environment: Variables of its environment.
        cwd: Its working folder; empty for that of the launch.
        on_screen: Whether its output goes to the screen instead of a log file.
        respawn: Whether it starts again after its end.
        respawn_delay_s: Time until then [s].
        respawn_max_retries: How often, at most; -1 for no limit.
        sigterm_timeout_s: Time after SIGINT until SIGTERM [s].
        sigkill_timeout_s: Time after SIGTERM until SIGKILL [s].
        node_name: Full name of the node; empty for a process that is no node, or names itself.
        is_node: Whether it understands `__log:=`.
        prepare: Called before parameters are set, with a look-up of parameters; may plan more of them.
        roslaunch_node: roslaunch's own node, of an XML launch file; then only `name` and `node_name` count.
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
