# SPDX-License-Identifier: BSD-3-Clause
"""What the modes complain of before an episode can run."""


class ModeError(Exception):
    """The settings of an episode, or a file they name, cannot be used; the message names the file and what to do."""
