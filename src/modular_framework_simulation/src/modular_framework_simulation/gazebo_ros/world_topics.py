# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the clock and its rate, the states of models and links, and the names of held objects."""

from __future__ import annotations

import time
from collections.abc import Sequence

import rospy
from gazebo_msgs.msg import LinkStates, ModelStates, PerformanceMetrics
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.gazebo_ros.packed_states import PackedLinkStates, PackedModelStates, PackedStates
from modular_framework_simulation.physics.part_names import SCOPE
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState

_QUEUE_SIZE = 50
"""Queue size; if simulated time is faster than real time, messages are sent in bursts."""
_CLOCK_LIMIT_HZ = 250.0
"""Maximum rate of /clock in real time [Hz]; every message wakes all nodes, which at 10 times real time took more than
one CPU core."""
_CLOCK_BURST = 5.0
"""Maximum number of consecutive /clock messages without a pause; the loop runs steps in groups and catches up."""


def stamp_of(world: PhysicsWorld) -> rospy.Time:
    """Returns the simulated time."""
    return rospy.Time(*divmod(world.time_ns, 1_000_000_000))


def init_node() -> None:
    """Initializes the node of the simulation, which sets its own time instead of subscribing to /clock."""
    rospy.init_node(ros_names.NODE, disable_rostime=True)
    if rospy.get_param("/use_sim_time", False):
        rospy.rostime._set_rostime(rospy.Time())


class ClockTopic:
    """Publishes /clock (rosgraph_msgs/Clock) and sets rospy's time in this node; used by the loop's thread.

    Args:
        world: World whose time is published.
    """

    def __init__(self, world: PhysicsWorld) -> None:
        self._world = world
        self._clock = rospy.Publisher(ros_names.CLOCK, Clock, queue_size=10, tcp_nodelay=True)
        self._credit = _CLOCK_BURST
        self._credit_time_s = time.monotonic()

    def publish(self) -> None:
        """Publishes the simulated time."""
        stamp = stamp_of(self._world)
        if not rospy.rostime.is_wallclock():
            rospy.rostime._set_rostime(stamp)
        self._clock.publish(Clock(stamp))

    def publish_within_limit(self) -> None:
        """Publishes the simulated time, at most 250 times per second of real time."""
        now_s = time.monotonic()
        self._credit = min(self._credit + (now_s - self._credit_time_s) * _CLOCK_LIMIT_HZ, _CLOCK_BURST)
        self._credit_time_s = now_s
        if self._credit >= 1.0:
            self._credit -= 1.0
            self.publish()


class WorldTopics:
    """Publishes the state of the world; all methods are called by the loop's thread.

    Publishes: /gazebo/model_states, /gazebo/link_states, /gazebo/performance_metrics (gazebo_msgs/PerformanceMetrics,
    without sensors), and /gazebo/grasped_object (std_msgs/String, latched; names of held objects separated by commas,
    or empty).

    Args:
        world: World of the models.
    """

    def __init__(self, world: PhysicsWorld) -> None:
        self._world = world
        self._models = rospy.Publisher(ros_names.MODEL_STATES, ModelStates, queue_size=_QUEUE_SIZE)
        self._links = rospy.Publisher(ros_names.LINK_STATES, LinkStates, queue_size=1)
        self._grasped = rospy.Publisher(ros_names.GRASPED_OBJECT, String, queue_size=1, latch=True)
        self._performance = rospy.Publisher(ros_names.PERFORMANCE_METRICS, PerformanceMetrics, queue_size=10)
        self._model_states, self._link_states = PackedModelStates(), PackedLinkStates()
        self._model_states.packed = PackedStates(world, lambda name: [(name, world.body(name).state())])
        self._link_states.packed = PackedStates(world, self._states_of_links)
        self._last_measurement = (time.monotonic(), world.time_ns)
        self._last_grasped: str | None = None
        self.publish_grasped(())

    def publish_models(self) -> None:
        """Publishes the states of all models, if there is a subscriber."""
        if self._models.get_num_connections():
            self._model_states.packed.update()
            self._models.publish(self._model_states)

    def publish_links(self) -> None:
        """Publishes the states of all links, if there is a subscriber."""
        if self._links.get_num_connections():
            self._link_states.packed.update()
            self._links.publish(self._link_states)

    def _states_of_links(self, name: str) -> list[tuple[str, BodyState]]:
        body = self._world.body(name)
        return [(f"{name}{SCOPE}{link}", body.link_state(link)) for link in body.link_names()]

    def publish_performance(self) -> None:
        """Publishes the real-time factor since the last call; publishes nothing after a reset of time."""
        real_s, simulated_ns = time.monotonic(), self._world.time_ns
        before_s, before_ns = self._last_measurement
        self._last_measurement = (real_s, simulated_ns)
        if self._performance.get_num_connections() and simulated_ns > before_ns:
            message = PerformanceMetrics(real_time_factor=(simulated_ns - before_ns) * 1e-9 / (real_s - before_s))
            message.header.stamp = stamp_of(self._world)
            self._performance.publish(message)

    def publish_grasped(self, names: Sequence[str]) -> None:
        """Publishes the names of the held objects if they have changed."""
        text = ",".join(names)
        if text != self._last_grasped:
            self._last_grasped = text
            self._grasped.publish(String(text))
