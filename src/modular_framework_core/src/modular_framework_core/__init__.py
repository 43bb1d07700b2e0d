# SPDX-License-Identifier: BSD-3-Clause
"""Managers, task constructor, sensor frames and spawners of the framework."""
