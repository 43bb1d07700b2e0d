# SPDX-License-Identifier: BSD-3-Clause
"""Readers of robot descriptions (URDF, SRDF) and of their meshes, for all packages."""
