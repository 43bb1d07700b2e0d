# SPDX-License-Identifier: BSD-3-Clause
"""Runs an episode on the real stack and records it."""
