# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of an episode, computed from its recording."""
