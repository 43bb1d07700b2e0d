# SPDX-License-Identifier: BSD-3-Clause
"""Occupancy maps of voxels, compatible with OctoMap."""
