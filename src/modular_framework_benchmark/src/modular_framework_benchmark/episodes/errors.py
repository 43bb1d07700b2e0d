# SPDX-License-Identifier: BSD-3-Clause
"""What keeps an episode of mode `task` from running to its end."""


class SettingsError(ValueError):
    """A setting of an episode has a wrong type or value; the text names it."""


class EpisodeAbortedError(RuntimeError):
    """The episode was ended from outside."""


class BagError(RuntimeError):
    """A bag is not recorded; the text says why."""


class VideoError(RuntimeError):
    """No video can be made of an episode; the text says why."""
