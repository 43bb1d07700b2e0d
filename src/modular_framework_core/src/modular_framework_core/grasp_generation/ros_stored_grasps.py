# SPDX-License-Identifier: BSD-3-Clause
"""Stores the grasps of a generator in the grasp manager; new grasps replace the previous grasps."""

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
    """Grasps that this generator has stored in the grasp manager.

    Services called: ``add_grasp``, ``remove_grasp``, ``list_grasps``, ``clear_anonymous_grasps``.
    """

    def __init__(self) -> None:
        self._names: list[str] = []

    def connect(self, timeout_s: float) -> None:
        """Waits for the grasp manager.

        Raises:
            CallError: A service does not appear within the timeout.
        """
        self._add = rospy.ServiceProxy("add_grasp", AddStandardisedGrasp)
        self._remove = rospy.ServiceProxy("remove_grasp", RemoveMessage)
        self._clear_anonymous = rospy.ServiceProxy("clear_anonymous_grasps", Trigger)
        self._list = rospy.ServiceProxy("list_grasps", ListMessages)
        for proxy in (self._add, self._remove, self._list, self._clear_anonymous):
            wait_for_service(proxy, timeout_s)

    @property
    def count(self) -> int:
        """Number of grasps of the last generation."""
        return len(self._names)

    def left(self) -> int:
        """Returns the number of grasps of the last generation that the manager still has.

        Raises:
            CallError: The manager does not respond.
        """
        stored = call_service(self._list, ListMessagesRequest(), SERVICE_TIMEOUT_S)
        return len(set(self._names) & set(stored.names)) + min(self._names.count(""), stored.anonymous)

    def replace(self, grasps: list[StandardisedGrasp], prefix: str) -> None:
        """Stores grasps and removes the previous grasps; previous anonymous grasps of all nodes are removed.

        Args:
            grasps: Grasps to store, best first.
            prefix: Prefix of the names ``<prefix>1``, ``<prefix>2``, ...; empty for anonymous grasps.

        Raises:
            CallError: The manager does not respond.
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
