# SPDX-License-Identifier: BSD-3-Clause
"""Collision checks of states and motions: compiled bounds first, then Coal's exact checks."""
