# SPDX-License-Identifier: BSD-3-Clause
"""Poses, shapes and solids in space."""
