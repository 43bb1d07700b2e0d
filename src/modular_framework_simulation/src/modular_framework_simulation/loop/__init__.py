# SPDX-License-Identifier: BSD-3-Clause
"""Simulation loop, which advances controllers, physics and time, and executes requests between the steps."""
