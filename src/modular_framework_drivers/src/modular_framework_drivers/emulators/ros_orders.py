# SPDX-License-Identifier: BSD-3-Clause
"""Offers the orders of an emulator as services too, for whoever has a ROS master and no TCP client at hand."""
from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

import rospy
from std_srvs.srv import Trigger, TriggerResponse

from modular_framework_drivers.emulators.command_port import Command


def offer_orders(orders: Mapping[str, Command]) -> list[rospy.Service]:
    """Advertise `~<order>` (std_srvs/Trigger) for every order that needs no argument."""
    return [rospy.Service(f"~{name}", Trigger, _Order(order)) for name, order in orders.items()
            if all(one.default is not one.empty for one in inspect.signature(order).parameters.values())]


class _Order:
    """One order as the callback of a service."""

    def __init__(self, order: Command) -> None:
        self._order = order

    def __call__(self, request: Any) -> TriggerResponse:
        del request
        try:
            return TriggerResponse(success=True, message=self._order() or "")
        except (OSError, ValueError) as error:
            return TriggerResponse(success=False, message=str(error))
