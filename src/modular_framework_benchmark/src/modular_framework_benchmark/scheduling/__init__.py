# SPDX-License-Identifier: BSD-3-Clause
"""Runs the episodes of an experiment on workers, each exactly once."""
