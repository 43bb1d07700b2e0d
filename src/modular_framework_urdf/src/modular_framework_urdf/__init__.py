# SPDX-License-Identifier: BSD-3-Clause
"""Readers of robot descriptions (URDF, SRDF) and of the meshes they refer to, for all packages."""
