# SPDX-License-Identifier: BSD-3-Clause
"""Kinematic constraints on robot states."""
