# SPDX-License-Identifier: BSD-3-Clause
"""Managers of messages, allowed collisions and object types, shared by all nodes of a task."""
