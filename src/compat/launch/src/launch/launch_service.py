# SPDX-License-Identifier: BSD-3-Clause
"""Launch service, which visits descriptions, starts processes, and handles events until the shutdown."""

from __future__ import annotations

import queue
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from launch.actions.events import EXIT_NODE_DIED, TimerAction
from launch.actions.launch_description import LaunchDescription
from launch.core.errors import LaunchError, located_error
from launch.core.launch_context import LaunchContext
from launch.core.launch_description_entity import LaunchDescriptionEntity
from launch.core.process_request import ProcessRequest
from launch.core.screen_log import get_logger
from launch.core.utilities import normalize_to_list_of_entities
from launch.events import Shutdown, TimerEvent
from launch.events.event import Event
from launch.events.process import ProcessExited, ProcessStarted, ShutdownProcess, SignalProcess

EXIT_BAD_LAUNCH = 2
"""Exit code for a description that cannot be executed."""
POLL_PERIOD_S = 0.1


class LaunchService:
    """Runs launch descriptions.

    The service visits a description completely, then sets its parameters, and then starts its processes in order. An
    error in the last action is therefore reported before any process has started.

    Args:
        argv: Arguments of the launch.
        noninteractive: Whether the launch runs without a user at a terminal.
        debug: Accepted without effect; see roslaunch's log.
        check: Function that is called with the context after all visits and before the first start.
    """

    def __init__(
        self,
        *,
        argv: Iterable[str] | None = None,
        noninteractive: bool = False,
        debug: bool = False,
        check: Callable[[LaunchContext], None] | None = None,
    ) -> None:
        del debug
        self.context = LaunchContext(argv=argv, noninteractive=noninteractive)
        self._check = check
        self._descriptions: list[LaunchDescription] = []
        self._incoming: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self._timers: list[tuple[float, TimerAction]] = []
        self._session: Any = None
        self._failed: list[str] = []
        self._exit_code = 0

    def include_launch_description(self, launch_description: LaunchDescription) -> None:
        """Adds a description."""
        self._descriptions.append(launch_description)

    def emit_event(self, event: Event) -> None:
        """Emits an event; may be called from any thread."""
        self._incoming.put(event)

    def shutdown(self, reason: str = "LaunchService.shutdown() was called") -> None:
        """Shuts the launch down; may be called from any thread."""
        self.emit_event(Shutdown(reason=reason))

    def run(self, *, shutdown_when_idle: bool = True) -> int:
        """Runs the descriptions to their end.

        Args:
            shutdown_when_idle: Whether to shut down if no process runs and no timer waits.

        Returns:
            0 after a shutdown by the description or a user; EXIT_BAD_LAUNCH if a description cannot be executed;
            EXIT_NODE_DIED if a required process failed, or if any process had failed when the last process ended.
        """
        with self._signals(), _environment_kept(self.context):
            try:
                for description in self._descriptions:
                    self._visit([description])
                if self._check is not None:
                    self._check(self.context)
                self._start_requested()
                self._handle_events(shutdown_when_idle)
            except LaunchError as error:
                get_logger().error("%s", error)
                self._exit_code = EXIT_BAD_LAUNCH
            finally:
                self.context.is_shutdown = True
                if self._session is not None:
                    self._session.close()
        return self._exit_code

    @contextmanager
    def _signals(self) -> Iterator[None]:
        """Converts SIGINT, SIGTERM and SIGHUP into a regular shutdown of the launch."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def on_signal(number: int, frame: object) -> None:
            del frame
            name = signal.Signals(number).name
            self.emit_event(Shutdown(reason=f"got {name}", due_to_sigint=number == signal.SIGINT))

        numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        before = {number: signal.signal(number, on_signal) for number in numbers}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _visit(self, entities: Iterable[LaunchDescriptionEntity]) -> None:
        for entity in entities:
            self._visit(entity.visit(self.context) or ())

    def _start_requested(self) -> None:
        """Sets the planned parameters, and starts the requested processes and timers."""
        context = self.context
        requests, context.requests = context.requests, []
        self._check_names(requests)
        if requests or context.parameters.has_changed():
            self._connect()
            for request in requests:
                if request.prepare is not None:
                    request.prepare(self._parameter)
            cleared = context.parameters.pop_cleared()
            self._session.set_parameters(context.parameters.pop_changed(), cleared)
        for request in requests:
            self._session.start(request)
        now_s = time.monotonic()
        self._timers += [(now_s + timer.period_s, timer) for timer in context.new_timers]
        context.new_timers = []

    def _check_names(self, requests: Iterable[ProcessRequest]) -> None:
        """Raises LaunchError for a second node with the same name, as the master would shut down the first node."""
        taken = {running.request.node_name for running in (self._session.running if self._session else ())}
        for request in requests:
            if request.node_name in taken and request.node_name:
                error = LaunchError(
                    f"there are two nodes {request.node_name}; allowed: one node per name; give this node another "
                    "name=... or namespace=..."
                )
                error.where = request.action.where if request.action is not None else ""
                raise error
            taken.add(request.node_name)

    def _connect(self) -> None:
        from launch.ros_process_session import RosProcessSession

        if self._session is None:
            self._session = RosProcessSession(self._process_ended)
        self._session.connect()

    def _parameter(self, name: str) -> Any:
        planned = self.context.parameters.get(name)
        return planned if planned is not None else self._session.parameter(name)

    def _process_ended(self, running: Any, exit_code: int) -> None:
        self._report_starts(running)
        if exit_code != 0:
            self._failed.append(running.request.name)
        self.emit_event(ProcessExited(*_process_description(running), returncode=exit_code))

    def _report_starts(self, running: Any) -> None:
        while running.seen_starts < running.process.spawn_count:
            running.seen_starts += 1
            self.emit_event(ProcessStarted(*_process_description(running)))

    def _handle_events(self, shutdown_when_idle: bool) -> None:
        while not self.context.is_shutdown:
            for running in self._session.running if self._session is not None else ():
                self._report_starts(running)
            event = self.context.next_event() or self._due_timer() or self._next_incoming()
            if event is not None:
                self._handle(event)
            elif self._session is not None and self._session.ended:
                self._handle(self._shutdown_of_required())
            elif shutdown_when_idle and self._is_idle():
                self._handle(Shutdown(reason="everything has ended", exit_code=EXIT_NODE_DIED if self._failed else 0))

    def _is_idle(self) -> bool:
        return not self._timers and self._incoming.empty() and not (self._session and self._session.running)

    def _next_incoming(self) -> Event | None:
        try:
            return self._incoming.get(timeout=0.0 if self._is_idle() else POLL_PERIOD_S)
        except queue.Empty:
            return None

    def _due_timer(self) -> Event | None:
        for entry in sorted(self._timers, key=lambda each: each[0]):
            if entry[1].cancelled or entry[0] <= time.monotonic():
                self._timers.remove(entry)
                return TimerEvent(timer_action=entry[1])
        return None

    def _shutdown_of_required(self) -> Shutdown:
        name, exit_code = self._session.required_death or ("a required node", 1)
        return Shutdown(reason=f"required node {name} ended", exit_code=EXIT_NODE_DIED if exit_code else 0)

    def _handle(self, event: Event) -> None:
        """Visits the entities of the event's handlers, and executes the event itself."""
        if isinstance(event, TimerEvent):
            self._handle_timer(event.timer_action)
        for handler, configurations in self.context.handlers_of(event):
            if handler.handle_once:
                self.context.unregister_event_handler(handler)
            with self.context.scope(configurations), self.context.local_scope():
                self._visit(self._reaction(handler, event))
        match event:
            case Shutdown():
                self._shut_down(event)
            case ShutdownProcess() | SignalProcess():
                self._reach_processes(event)
            case _:
                self._start_requested()

    def _reaction(self, handler: Any, event: Event) -> list[LaunchDescriptionEntity]:
        try:
            return normalize_to_list_of_entities(handler.handle(event, self.context))
        except LaunchError:
            raise
        except Exception as error:  # functions of a launch file may raise anything
            raise located_error(f"{type(handler).__name__}", error, "") from error

    def _handle_timer(self, timer: TimerAction) -> None:
        if not timer.cancelled:
            with self.context.scope(timer.configurations):
                self._visit(timer.actions)

    def _shut_down(self, event: Shutdown) -> None:
        self.context.is_shutdown = True
        self._exit_code = event.exit_code
        failed = f"; failed: {', '.join(dict.fromkeys(self._failed))}" if self._failed else ""
        get_logger().info("the launch shuts down: %s%s", event.reason, failed)

    def _reach_processes(self, event: ShutdownProcess | SignalProcess) -> None:
        for running in self._session.running if self._session is not None else ():
            if running.request.action is None or not event.process_matcher(running.request.action):
                continue
            if isinstance(event, SignalProcess):
                running.process.popen.send_signal(event.signal)
            else:
                self._session.stop(running)


def _process_description(running: Any) -> tuple[Any, str, list[str], int, str | None, dict[str, str]]:
    request = running.request
    return (
        request.action,
        running.process.name,
        list(running.process.args),
        running.pid,
        request.cwd or None,
        dict(running.process.env),
    )


@contextmanager
def _environment_kept(context: LaunchContext) -> Iterator[None]:
    """Restores the initial environment at the end."""
    try:
        yield
    finally:
        context.reset_environment()
