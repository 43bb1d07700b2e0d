# SPDX-License-Identifier: BSD-3-Clause
"""Serves the episodes of an experiment: their table, an episode by its number, and pairs of episodes."""

from __future__ import annotations

import json
import threading
from dataclasses import asdict
from typing import Any

from modular_framework_ui.page_source import PAIR_PAGE, RUN_PAGE, TASK_PAGE, ChangesSince, PageSource, Query
from modular_framework_ui.recorded_episode import read_episode
from modular_framework_ui.recorded_run import RecordedRun, RunEpisode, differences
from modular_framework_ui.recorded_task import ReplayError
from modular_framework_ui.replayed_episode import ReplayedEpisode

MAX_EPISODES = 8
"""Maximum number of episodes in memory."""


class ReplayedRun(PageSource):
    """The episodes of an experiment by the query of the address.

    | query | page |
    |---|---|
    | `episode=12` | the episode; with `clock=simulated`, in simulated time |
    | `pair=12,15` | both episodes side by side in simulated time |
    | other | the table of the episodes |

    Args:
        run: Episodes of the experiment.
        host: Address of the viewers of recorded worlds.
    """

    def __init__(self, run: RecordedRun, host: str) -> None:
        self._run, self._host = run, host
        self._episodes: dict[tuple[int, bool], ReplayedEpisode] = {}
        self._lock = threading.Lock()

    def page(self, query: Query) -> str:
        """Returns the URL path of the page for a query."""
        if "pair" in query:
            return PAIR_PAGE
        return TASK_PAGE if "episode" in query else RUN_PAGE

    def table(self, query: Query) -> str:
        """Returns the table of the experiment, of the partners of an episode, or of a pair, as JSON.

        Raises:
            ReplayError: An episode is not finished, or has no record of its task.
        """
        if "pair" in query:
            return self._pair(query["pair"])
        if "episode" in query:
            partners = self._run.replayable(_number_of(query["episode"])).partners
            shown = [self._run.episodes[number] for number in partners]
            return json.dumps({"partners": [_row(each) for each in shown if each.folder is not None]})
        rows = [_row(episode) for episode in self._run.episodes.values()]
        title = {"title": self._run.title, "compared": self._run.compared, "planned": self._run.planned}
        return json.dumps(title | {"episodes": rows})

    def changes(self, query: Query) -> ChangesSince:
        """Returns the changes of an episode; reads the record of the episode.

        Raises:
            ReplayError: The episode has no record of its task, or the record cannot be read.
        """
        episode = self._run.replayable(_number_of(query.get("episode", "")))
        assert episode.folder is not None
        key = _key(query)
        with self._lock:
            opened = self._episodes.pop(key, None)
            if opened is None:
                if len(self._episodes) == MAX_EPISODES:
                    self._episodes.pop(next(iter(self._episodes))).close()
                opened = ReplayedEpisode(read_episode(episode.folder, in_simulated_time=key[1]), self._host)
            self._episodes[key] = opened  # the latest last
            return opened.changes_since

    def show(self, query: Query, time_s: float | None) -> None:
        """Shows the recorded world of an open episode at a time.

        Args:
            query: Query of the page.
            time_s: Time since the start of the task [s]; None for the end of the task.
        """
        with self._lock:
            opened = self._episodes.get(_key(query))
            if opened is not None:
                opened.show(time_s)

    def close(self) -> None:
        """Ends the viewers of all episodes; may be called twice."""
        with self._lock:
            for opened in self._episodes.values():
                opened.close()
            self._episodes.clear()

    def _pair(self, text: str) -> str:
        numbers = text.split(",")
        if len(numbers) != 2:
            raise ReplayError(f"pair={text} does not name two episodes; allowed: two numbers, such as pair=12,15")
        first, second = (self._run.replayable(_number_of(number)) for number in numbers)
        is_pair = second.number in first.partners
        return json.dumps(
            {
                "title": self._run.title,
                "sides": [_row(first), _row(second)],
                "differences": [asdict(each) for each in differences(first, second)],
                "note": "" if is_pair else "These episodes are no pair: method, trial or other levels do not fit.",
            }
        )


def _row(episode: RunEpisode) -> dict[str, Any]:
    """Returns an episode as JSON values, without paths of this computer."""
    return asdict(episode) | {"folder": None, "is_replayable": episode.folder is not None}


def _key(query: Query) -> tuple[int, bool]:
    """Returns the number of an episode, and whether its times are simulated."""
    return _number_of(query.get("episode", "")), query.get("clock") == "simulated"


def _number_of(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise ReplayError(f"'{text}' is no number of an episode; allowed: a number, such as episode=12")
    return int(text)
