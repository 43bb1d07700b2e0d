# SPDX-License-Identifier: BSD-3-Clause
"""ExecuteProcess, which starts a program under roslaunch's process monitor."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from launch.actions.process_handlers import OnProcessExit
from launch.core.action import Action
from launch.core.errors import LaunchError, hint
from launch.core.launch_context import LaunchContext
from launch.core.process_request import ProcessRequest
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.substitution import Substitution
from launch.core.utilities import normalize_to_list_of_substitutions, perform_boolean, perform_number, perform_text
from launch.substitutions.text import LaunchConfiguration, described

OUTPUTS = {"screen": True, "both": True, "full": True, "log": False, "own_log": False}
"""Allowed values of `output`, and whether standard output is printed on the screen."""
DEFAULT_TIMEOUTS_S = {"sigterm_timeout": 15.0, "sigkill_timeout": 5.0}
"""Times from SIGINT to SIGTERM, as in roslaunch, and from SIGTERM to SIGKILL [s]."""
UNSUPPORTED = ("emulate_tty", "output_format", "cached_output", "log_cmd")
"""ROS 2 options of the process output; accepted and ignored, because processes write their own output."""


class ExecuteLocal(Action):
    """Starts a program.

    Args:
        cmd: Program and arguments; each element may be a sequence of substitutions, which is concatenated.
        prefix: Prefix of the command, such as a debugger; the default is the configuration `launch-prefix`.
        name: Name of the process in messages; the default is the name of the program.
        cwd: Working directory; the default is the directory of the launch.
        env: Complete environment.
        additional_env: Additional environment variables.
        shell: Whether a shell executes the command.
        options: `output` (screen, both, full: on the screen; log, own_log: in a file), `respawn`, `respawn_delay` [s],
            `respawn_max_retries`, `sigterm_timeout`, `sigkill_timeout` [s], `on_exit`, `condition`.
    """

    def __init__(
        self,
        *,
        cmd: Iterable[SomeSubstitutionsType],
        prefix: SomeSubstitutionsType | None = None,
        name: SomeSubstitutionsType | None = None,
        cwd: SomeSubstitutionsType | None = None,
        env: Mapping[Any, SomeSubstitutionsType] | None = None,
        additional_env: Mapping[Any, SomeSubstitutionsType] | None = None,
        shell: bool = False,
        **options: Any,
    ) -> None:
        super().__init__(condition=options.pop("condition", None))
        if isinstance(cmd, str | Substitution):
            raise TypeError(
                f"{self.where}: cmd is a single string; allowed: a list of program and arguments, cmd=[...]"
            )
        self._cmd = [normalize_to_list_of_substitutions(part) for part in cmd]
        self._prefix, self._name, self._cwd = prefix, name, cwd
        self._env, self._additional_env, self._shell = env, dict(additional_env or {}), shell
        self._on_exit = options.pop("on_exit", None)
        self._options = {key: value for key, value in options.items() if key not in UNSUPPORTED}
        unknown = sorted(set(self._options) - set(_OPTION_DEFAULTS))
        if unknown:
            allowed = sorted((*_OPTION_DEFAULTS, "on_exit", "condition"))
            raise TypeError(
                f"{self.where}: {type(self).__name__}: unknown argument '{unknown[0]}'{hint(unknown[0], allowed)}; "
                f"allowed: {', '.join(allowed)} and the arguments of the signature"
            )

    @property
    def cmd(self) -> list[list[Substitution]]:
        """Returns program and arguments."""
        return self._cmd

    def describe(self) -> str:
        return f"{type(self).__name__}({' '.join(described(part) for part in self._cmd)})"

    def execute(self, context: LaunchContext) -> None:
        if self._on_exit is not None:
            context.register_event_handler(OnProcessExit(target_action=self, on_exit=self._on_exit))
        context.requests.append(self.process_request(context))

    def process_request(self, context: LaunchContext) -> ProcessRequest:
        """Returns the request to start the process."""
        command = [perform_text(context, part) for part in self._cmd]
        if not command or not command[0]:
            raise LaunchError("the command is empty; allowed: a program and its arguments")
        program = shlex.split(command[0])[0] if self._shell else command[0]
        name = perform_text(context, self._name) if self._name is not None else Path(program).name
        command = ["/bin/sh", "-c", " ".join(command)] if self._shell else command
        return ProcessRequest(
            action=self,
            name=name,
            command=[*self.prefix_of(context, program), *command],
            environment=self._environment(context),
            cwd=perform_text(context, self._cwd) if self._cwd is not None else "",
            **self._performed_options(context),
        )

    def prefix_of(self, context: LaunchContext, program: str) -> list[str]:
        """Returns the prefix of the command."""
        prefix = self._prefix if self._prefix is not None else LaunchConfiguration("launch-prefix", default="")
        pattern = perform_text(context, LaunchConfiguration("launch-prefix-filter", default=""))
        if self._prefix is None and pattern and not re.match(pattern, os.path.basename(program)):
            return []
        return shlex.split(perform_text(context, prefix))

    def _environment(self, context: LaunchContext) -> dict[str, str]:
        base = context.environment if self._env is None else _perform_mapping(context, self._env)
        return {**base, **_perform_mapping(context, self._additional_env)}

    def _performed_options(self, context: LaunchContext) -> dict[str, Any]:
        given = {**_OPTION_DEFAULTS, **self._options}
        output = given["output"]
        if not isinstance(output, dict):
            output = perform_text(context, output)
            if output not in OUTPUTS:
                raise LaunchError(f"output is '{output}'; allowed: {', '.join(OUTPUTS)}{hint(output, OUTPUTS)}")
        on_screen = OUTPUTS[output] if isinstance(output, str) else "screen" in str(output.get("stdout", ""))
        respawn_delay = given["respawn_delay"]
        return {
            "on_screen": on_screen,
            "respawn": perform_boolean(context, given["respawn"], "respawn"),
            "respawn_delay_s": perform_number(
                context, 0.0 if respawn_delay is None else respawn_delay, "respawn_delay"
            ),
            "respawn_max_retries": int(perform_number(context, given["respawn_max_retries"], "respawn_max_retries")),
            "sigterm_timeout_s": _timeout(context, given, "sigterm_timeout"),
            "sigkill_timeout_s": _timeout(context, given, "sigkill_timeout"),
        }


_OPTION_DEFAULTS: dict[str, Any] = {
    "output": "log",
    "respawn": False,
    "respawn_delay": None,
    "respawn_max_retries": -1,
    "sigterm_timeout": None,
    "sigkill_timeout": None,
}


def _timeout(context: LaunchContext, given: Mapping[str, Any], name: str) -> float:
    value = given[name] if given[name] is not None else LaunchConfiguration(name, default=DEFAULT_TIMEOUTS_S[name])
    timeout_s = perform_number(context, value, name)
    if timeout_s <= 0.0:
        raise LaunchError(f"{name} is {timeout_s} s; allowed: more than 0")
    return timeout_s


def _perform_mapping(context: LaunchContext, texts: Mapping[Any, SomeSubstitutionsType]) -> dict[str, str]:
    return {perform_text(context, name): perform_text(context, value) for name, value in texts.items()}


class ExecuteProcess(ExecuteLocal):
    """Starts a program; see `ExecuteLocal`."""
