# SPDX-License-Identifier: BSD-3-Clause
"""Monitors that keep the planning scene up to date from topics, tf and sensors."""
