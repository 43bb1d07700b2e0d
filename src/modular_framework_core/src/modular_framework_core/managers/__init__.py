# SPDX-License-Identifier: BSD-3-Clause
"""Managers: named and anonymous messages, allowed collisions and object types, shared by all nodes of a task."""
