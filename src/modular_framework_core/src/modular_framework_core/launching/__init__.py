# SPDX-License-Identifier: BSD-3-Clause
"""Runs a launch and reports how it ended; starts controllers and the node of the manipulator."""
