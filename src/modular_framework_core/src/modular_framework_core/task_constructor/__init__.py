# SPDX-License-Identifier: BSD-3-Clause
"""The task constructor: checks a task written in YAML and generates the state machine that runs the task."""
