# SPDX-License-Identifier: BSD-3-Clause
"""Base class of every controller, and the gains that several of them use."""

from modular_framework_control.controller_interface.controller import Controller

__all__ = ["Controller"]
