# SPDX-License-Identifier: BSD-3-Clause
"""Compiled kernels of the collision checks."""
