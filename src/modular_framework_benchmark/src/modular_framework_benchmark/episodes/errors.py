# SPDX-License-Identifier: BSD-3-Clause
"""Errors of episodes of mode `task`."""


class EpisodeAbortedError(RuntimeError):
    """The episode was aborted from outside."""


class BagError(RuntimeError):
    """A bag is not recorded; the message gives the reason."""


class SceneError(RuntimeError):
    """The scene of an episode cannot be rebuilt; the message gives the reason."""
