# SPDX-License-Identifier: BSD-3-Clause
"""Robot model from URDF, SRDF and joint limits."""
