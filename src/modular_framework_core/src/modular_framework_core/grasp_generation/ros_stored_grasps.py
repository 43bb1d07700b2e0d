# SPDX-License-Identifier: BSD-3-Clause
"""Keeps the grasps of a generator in the grasp manager: new ones take the place of those stored before."""

from __future__ import annotations

import rospy
from std_srvs.srv import Trigger, TriggerRequest

from modular_framework_core.msg import StandardisedGrasp
from modular_framework_core.srv import (
    AddStandardisedGrasp,
    AddStandardisedGraspRequest,
    ListMessages,
    ListMessagesRequest,
    RemoveMessage,
    RemoveMessageRequest,
)
from modular_framework_ros.calls import call_service, wait_for_service

SERVICE_TIMEOUT_S = 10.0


class StoredGrasps:
    """The grasps one generator has stored.

    Services called: ``add_grasp``, ``remove_grasp``, ``list_grasps``, ``clear_anonymous_grasps``.
    """

    def __init__(self) -> None:
        self._names: list[str] = []

    def connect(self, timeout_s: float) -> None:
        """Waits for the manager.

        Raises:
            CallError: It is not there in time.
        """
        self._add = rospy.ServiceProxy("add_grasp", AddStandardisedGrasp)
        self._remove = rospy.ServiceProxy("remove_grasp", RemoveMessage)
        self._clear_anonymous = rospy.ServiceProxy("clear_anonymous_grasps", Trigger)
        self._list = rospy.ServiceProxy("list_grasps", ListMessages)
        for proxy in (self._add, self._remove, self._list, self._clear_anonymous):
            wait_for_service(proxy, timeout_s)

    @property
    def count(self) -> int:
        """Number of grasps that were stored last."""
        return len(self._names)

    def left(self) -> int:
        """Returns how many of them the manager still has.

        Raises:
            CallError: The manager does not answer.
        """
        there = call_service(self._list, ListMessagesRequest(), SERVICE_TIMEOUT_S)
        return len(set(self._names) & set(there.names)) + min(self._names.count(""), there.anonymous)

    def replace(self, grasps: list[StandardisedGrasp], prefix: str) -> None:
        """Stores grasps and removes the earlier ones; anonymous ones of others go with them.

        Args:
            grasps: What to store, best first.
            prefix: They are named ``<prefix>1``, ``<prefix>2``, ...; empty stores them anonymously.

        Raises:
            CallError: The manager does not answer.
        """
        names = [f"{prefix}{number}" if prefix else "" for number, _ in enumerate(grasps, start=1)]
        if "" in self._names:
            call_service(self._clear_anonymous, TriggerRequest(), SERVICE_TIMEOUT_S)
        for name in sorted(set(self._names) - {"", *names}):
            call_service(self._remove, RemoveMessageRequest(name=name), SERVICE_TIMEOUT_S)
        for grasp, name in zip(grasps, names, strict=True):
            request = AddStandardisedGraspRequest(grasp_message=grasp, grasp_name=name)
            call_service(self._add, request, SERVICE_TIMEOUT_S)
        self._names = names
