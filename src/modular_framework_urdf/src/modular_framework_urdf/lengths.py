# SPDX-License-Identifier: BSD-3-Clause
"""Maximum length in descriptions and scenes."""

from __future__ import annotations

MAX_LENGTH_M = 1.0e4
"""Maximum size of a shape and coordinate of a mesh, which keeps collision checks and physics precise to 1 mm [m]."""
