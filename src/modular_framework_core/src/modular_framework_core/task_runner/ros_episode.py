# SPDX-License-Identifier: BSD-3-Clause
"""Resets a running stack to the start of an episode, with the same state as after a cold start.

With the parameters ``/wait_for_planning`` and ``/seed``, the same episode gives the same motions.
"""

from __future__ import annotations

from collections.abc import Callable

import rospy
import rosservice
from std_srvs.srv import Trigger, TriggerRequest

from modular_framework_core.srv import ReinitManager, ReinitManagerRequest, UpdateACMEntry, UpdateACMEntryRequest
from modular_framework_ros.calls import CallError, request_service
from modular_framework_ros.simulated_time import SimulatedTime

RESTART_SERVICE = "/gazebo/restart"
GENERATE_SERVICE = "generate_grasps"
COLLISION_MATRIX_SERVICE = "update_acm_entry"
REINITIALISE_PREFIX = "reinitialise_"
SERVICE_TIMEOUT_S = 30.0
GENERATION_TIMEOUT_S = 300.0


class EpisodeError(RuntimeError):
    """An episode cannot begin."""


def begin_episode(spawn: Callable[[], None], settle_s: float) -> None:
    """Begins an episode: restarts the world, spawns and settles the objects, and resets the managers.

    The caller must hold simulated time until the end of the episode. The next step is :func:`generate_grasps`.

    Args:
        spawn: Function that spawns the objects of the episode.
        settle_s: Settling time of the objects [s, simulated time].

    Raises:
        EpisodeError: A node does not answer or reports a failure.
    """
    try:
        _trigger(RESTART_SERVICE, SERVICE_TIMEOUT_S)
        spawn()
        if settle_s > 0.0:
            SimulatedTime().sleep(settle_s)
        _forget_messages(set(rosservice.get_service_list()))
    except CallError as error:
        raise EpisodeError(f"the episode cannot begin: {error}") from error


def generate_grasps() -> bool:
    """Asks the method to generate grasps and returns whether the service exists. The task handles an empty result.

    Raises:
        CallError: The method does not answer.
    """
    if rospy.resolve_name(GENERATE_SERVICE) not in rosservice.get_service_list():
        return False
    response = request_service(GENERATE_SERVICE, Trigger, TriggerRequest(), GENERATION_TIMEOUT_S)
    rospy.loginfo("%s: %s", GENERATE_SERVICE, response.message)
    return True


def _forget_messages(services: set[str]) -> None:
    """Resets the messages and allowed collisions that the previous episode added to the managers."""
    for name in sorted(name for name in services if name.rpartition("/")[2].startswith(REINITIALISE_PREFIX)):
        request_service(name, ReinitManager, ReinitManagerRequest(), SERVICE_TIMEOUT_S)
    if rospy.resolve_name(COLLISION_MATRIX_SERVICE) in services:
        request = UpdateACMEntryRequest(action=UpdateACMEntryRequest.REINIT)
        request_service(COLLISION_MATRIX_SERVICE, UpdateACMEntry, request, SERVICE_TIMEOUT_S)


def _trigger(name: str, timeout_s: float) -> None:
    response = request_service(name, Trigger, TriggerRequest(), timeout_s)
    if not response.success:
        raise CallError(f"service '{name}': {response.message}")
