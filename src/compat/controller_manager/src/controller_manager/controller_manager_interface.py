# SPDX-License-Identifier: BSD-3-Clause
"""Asks the controller manager of the node's namespace, prints the answer and returns whether it did what was asked."""

from modular_framework_control.ros.controller_manager_interface import (
    list_controller_types,
    list_controllers,
    load_controller,
    reload_libraries,
    start_controller,
    start_controllers,
    start_stop_controllers,
    stop_controller,
    stop_controllers,
    unload_controller,
)

__all__ = [
    "list_controller_types",
    "list_controllers",
    "load_controller",
    "reload_libraries",
    "start_controller",
    "start_controllers",
    "start_stop_controllers",
    "stop_controller",
    "stop_controllers",
    "unload_controller",
]
