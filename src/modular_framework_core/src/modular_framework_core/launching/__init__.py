# SPDX-License-Identifier: BSD-3-Clause
"""Starts a launch and says how it ended; starts controllers and the node of the manipulator."""
