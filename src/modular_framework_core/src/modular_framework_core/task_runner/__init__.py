# SPDX-License-Identifier: BSD-3-Clause
"""Runs a task: its userdata, its states, and the record of what they did."""
