# SPDX-License-Identifier: BSD-3-Clause
"""The robot: its URDF, SRDF and joint limits joined into one model."""
