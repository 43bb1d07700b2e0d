# SPDX-License-Identifier: BSD-3-Clause
"""Reads the description of a simulated robot: links, joints, masses."""
