# SPDX-License-Identifier: BSD-3-Clause
"""Functions that call the controller manager in the node's namespace, print the response and return the success."""

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
