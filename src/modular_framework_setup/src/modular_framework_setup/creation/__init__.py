# SPDX-License-Identifier: BSD-3-Clause
"""Creates the two packages of a robot from its URDF."""
