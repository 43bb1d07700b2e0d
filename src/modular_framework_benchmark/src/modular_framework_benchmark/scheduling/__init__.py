# SPDX-License-Identifier: BSD-3-Clause
"""Distributes the episodes of an experiment to workers; each episode runs exactly once."""
