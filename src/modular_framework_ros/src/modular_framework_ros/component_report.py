# SPDX-License-Identifier: BSD-3-Clause
"""Publishes reports of the components' runs on one topic, from which the benchmark computes component metrics."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field

import rospy
from std_msgs.msg import String

from modular_framework_ros.publishing import publish
from modular_framework_ros.reported_figures import Figure

TOPIC = "component_reports"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportedMethod:
    """A method that worked in its own process.

    Attributes:
        command: Program and arguments that started the method; empty for a running method.
        address: Address of a running method; "" for a command.
        sources: SHA-256 of the sources that the process has imported; "" if the process does not report it.
        said_name: Name that the method states about itself; not verified.
        said_version: Version that the method states about itself; not verified.
    """

    command: tuple[str, ...] = ()
    address: str = ""
    sources: str = ""
    said_name: str = ""
    said_version: str = ""


@dataclass
class Work:
    """A running task of a component.

    Attributes:
        figures: Values of the component's own figures, such as the number of candidates.
        reason: Reason of the failure; "" without a failure.
        method: Method in its own process that worked; None without such a method.
    """

    figures: dict[Figure, float] = field(default_factory=dict)
    reason: str = ""
    method: ReportedMethod | None = None


class ComponentReporter:
    """Publishes ``component_reports`` (std_msgs/String, JSON): one message at the end of each task of a component.

    Keys: ``component``, ``name``, ``succeeded``, ``reason``, ``started`` and ``ended`` (ROS time [s]), ``wall_s`` (real
    time [s]), ``figures`` (name to number, see `reported_figures`), and ``method`` (fields of `ReportedMethod`) after
    the work of a method in its own process.
    """

    def __init__(self, component: str) -> None:
        """Advertises the topic.

        Args:
            component: ``generation``, ``planning``, ``execution``, ``grasp``, or a user-defined name.
        """
        self._component = component
        self._publisher = rospy.Publisher(TOPIC, String, queue_size=100)

    @contextmanager
    def work(self, name: str) -> Iterator[Work]:
        """Reports the body of the with statement as a task; an exception is reported as its failure and re-raised.

        Args:
            name: Name of the task, such as the name of the method.
        """
        work, started, wall = Work(), rospy.get_time(), time.monotonic()
        try:
            yield work
        except BaseException as error:
            work.reason = str(error) or type(error).__name__
            raise
        finally:
            entry = {
                "component": self._component,
                "name": name,
                "succeeded": not work.reason,
                "reason": work.reason,
                "started": started,
                "ended": rospy.get_time(),
                "wall_s": time.monotonic() - wall,
                "figures": {figure.name: value for figure, value in work.figures.items()},
            }
            if work.method is not None:
                entry["method"] = asdict(work.method)
            publish(self._publisher, String(json.dumps(entry)))
