# SPDX-License-Identifier: BSD-3-Clause
"""The task constructor: reads a task written in YAML, checks all of it, and writes the state machine that runs it."""
