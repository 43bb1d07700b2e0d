# SPDX-License-Identifier: BSD-3-Clause
"""The largest length a description or a scene may give."""

from __future__ import annotations

LARGEST_LENGTH_M = 1.0e4
"""Of a shape's size and of a mesh's coordinates: beyond it, collision checks and physics lose the millimetre [m]."""
