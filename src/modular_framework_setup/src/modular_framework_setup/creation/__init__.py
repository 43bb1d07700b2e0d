# SPDX-License-Identifier: BSD-3-Clause
"""Makes the two packages of a robot from its URDF."""
