# SPDX-License-Identifier: BSD-3-Clause
"""Viewer of world, robot, planning scene, plan and cameras in a browser, based on public topics and services."""
