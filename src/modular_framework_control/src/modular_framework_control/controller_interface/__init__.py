# SPDX-License-Identifier: BSD-3-Clause
"""Base class of controllers, and PID control."""

from modular_framework_control.controller_interface.controller import Controller

__all__ = ["Controller"]
