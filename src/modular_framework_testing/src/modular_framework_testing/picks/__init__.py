# SPDX-License-Identifier: BSD-3-Clause
"""Simulated picks: of every object of the standard set, and stopped by Ctrl-C."""
