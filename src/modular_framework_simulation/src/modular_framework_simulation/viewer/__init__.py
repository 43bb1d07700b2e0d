# SPDX-License-Identifier: BSD-3-Clause
"""Shows world, robot, planning scene, plan and cameras in a browser; reads public topics and services only."""
