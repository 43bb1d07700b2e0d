# SPDX-License-Identifier: BSD-3-Clause
"""Errors of the modes without simulation."""


class ModeError(Exception):
    """A setting of an episode, or a file that it names, is invalid; the message names the file and the remedy."""
