# SPDX-License-Identifier: BSD-3-Clause
"""Brings a running stack to the state in which an episode begins, the same after a cold start and after an episode.

What can be asked for with the parameters ``/wait_for_planning`` and ``/seed``: the same episode gives the same motions.
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
    """An episode cannot begin; the text says why."""


def begin_episode(spawn: Callable[[], None], settle_s: float) -> None:
    """Begins an episode; simulated time has to be held by the caller, from here to the end of the episode.

    In this sequence: the world begins again, objects are spawned while time stands still, they settle, the managers
    forget what was added. Grasps are generated next, see :func:`generate_grasps`.

    Args:
        spawn: Puts the objects of the episode into the world.
        settle_s: Simulated time for them to settle [s].

    Raises:
        EpisodeError: A node does not do its part.
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
    """Asks the method to generate grasps; returns whether it offers the service. The task handles an empty result.

    Raises:
        CallError: the method does not answer.
    """
    if rospy.resolve_name(GENERATE_SERVICE) not in rosservice.get_service_list():
        return False
    answer = request_service(GENERATE_SERVICE, Trigger, TriggerRequest(), GENERATION_TIMEOUT_S)
    rospy.loginfo("%s: %s", GENERATE_SERVICE, answer.message)
    return True


def _forget_messages(services: set[str]) -> None:
    """Makes the managers forget what the episode before added, and drops the collisions that it allowed."""
    for name in sorted(name for name in services if name.rpartition("/")[2].startswith(REINITIALISE_PREFIX)):
        request_service(name, ReinitManager, ReinitManagerRequest(), SERVICE_TIMEOUT_S)
    if rospy.resolve_name(COLLISION_MATRIX_SERVICE) in services:
        request = UpdateACMEntryRequest(action=UpdateACMEntryRequest.REINIT)
        request_service(COLLISION_MATRIX_SERVICE, UpdateACMEntry, request, SERVICE_TIMEOUT_S)


def _trigger(name: str, timeout_s: float) -> None:
    answer = request_service(name, Trigger, TriggerRequest(), timeout_s)
    if not answer.success:
        raise CallError(f"service '{name}': {answer.message}")
