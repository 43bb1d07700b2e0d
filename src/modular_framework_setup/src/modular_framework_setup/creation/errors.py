# SPDX-License-Identifier: BSD-3-Clause
"""Why no packages can be made."""

from __future__ import annotations


class CreationError(Exception):
    """The packages of a robot cannot be made; the text says what was found, what is allowed and what to do."""
