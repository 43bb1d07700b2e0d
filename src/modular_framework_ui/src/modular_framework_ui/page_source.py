# SPDX-License-Identifier: BSD-3-Clause
"""Contents of the page by the query of its address: the running task, a record, or the episodes of an experiment."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from modular_framework_ui.recorded_task import ReplayError
from modular_framework_ui.task_state import TaskChanges

Query = Mapping[str, str]
"""Values of the query of an address, such as `episode=12`, keyed by name."""
ChangesSince = Callable[[int], TaskChanges]
"""Function that returns the changes after a revision."""
TASK_PAGE, RUN_PAGE, PAIR_PAGE = "/", "/episodes.html", "/pair.html"
"""URL paths of the pages of a task, of an experiment, and of a pair of episodes."""


class PageSource:
    """A single task, whatever the query.

    Args:
        changes_since: Function that returns the changes after a revision.
    """

    def __init__(self, changes_since: ChangesSince) -> None:
        self._changes_since = changes_since

    def page(self, query: Query) -> str:
        """Returns the URL path of the page for a query."""
        return TASK_PAGE

    def table(self, query: Query) -> str:
        """Returns the table of an experiment, or of a pair of its episodes, as JSON.

        Raises:
            ReplayError: There is no experiment, or no episode of this number.
        """
        raise ReplayError("there is no experiment; open the page with --replay and a result database")

    def changes(self, query: Query) -> ChangesSince:
        """Returns the function that returns the changes of the task. May read files.

        Raises:
            ReplayError: There is no episode of this number, or its record cannot be read.
        """
        return self._changes_since

    def show(self, query: Query, time_s: float | None) -> None:
        """Shows the recorded world of the task at a time.

        Args:
            query: Query of the page.
            time_s: Time since the start of the task [s]; None for the end of the task.

        Raises:
            ReplayError: The task is not recorded.
        """
        raise ReplayError("the page of a running task is read-only")

    def close(self) -> None:
        """Ends the viewers of recorded worlds; may be called twice."""
