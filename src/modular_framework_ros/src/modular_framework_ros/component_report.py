# SPDX-License-Identifier: BSD-3-Clause
"""Lets a component report what it did, on one topic for all of them: what benchmarks measure components by."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import rospy
from std_msgs.msg import String

from modular_framework_ros.publishing import publish
from modular_framework_ros.reported_figures import Figure

TOPIC = "component_reports"


@dataclass
class Work:
    """One piece of work of a component, while it is done.

    Attributes:
        figures: Its own figures, such as how many candidates there were.
        reason: Why it failed; "" while it has not.
    """

    figures: dict[Figure, float] = field(default_factory=dict)
    reason: str = ""


class ComponentReporter:
    """Publishes ``component_reports`` (std_msgs/String, JSON), one message for each piece of work when it ends.

    Keys: ``component``, ``name``, ``succeeded``, ``reason``, ``started`` and ``ended`` (ROS time [s]), ``wall_s`` (real
    time [s]), ``figures`` (name to number, see `reported_figures`).
    """

    def __init__(self, component: str) -> None:
        """Advertises the topic.

        Args:
            component: ``generation``, ``planning``, ``execution``, ``grasp``, or a name of your own.
        """
        self._component = component
        self._publisher = rospy.Publisher(TOPIC, String, queue_size=100)

    @contextmanager
    def work(self, name: str) -> Iterator[Work]:
        """Reports what is done within; an exception is reported as the reason of a failure, and raised on.

        Args:
            name: What is done, such as the name of the method.
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
            publish(self._publisher, String(json.dumps(entry)))
