# SPDX-License-Identifier: BSD-3-Clause
"""Emulated servo lines for the tests of the drivers."""

from modular_framework_testing.emulators.dynamixel_fixture import make_line  # noqa: F401
