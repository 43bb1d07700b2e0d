# SPDX-License-Identifier: BSD-3-Clause
"""Errors of episodes of mode `task`."""


class EpisodeAbortedError(RuntimeError):
    """The episode was aborted from outside."""


class BagError(RuntimeError):
    """A bag is not recorded; the message gives the reason."""


class SceneError(RuntimeError):
    """The scene of an episode cannot be rebuilt, or its video cannot be encoded; the message gives the reason."""
