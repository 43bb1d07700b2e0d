# SPDX-License-Identifier: BSD-3-Clause
"""Runs a task, provides its userdata and records its states."""
