# SPDX-License-Identifier: BSD-3-Clause
"""Displays the progress of an experiment: a bar on a terminal, periodic lines elsewhere."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable
from typing import TextIO

from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeStatus
from modular_framework_benchmark.scheduling.earlier_tries import EARLIER_TRIES

BAR_PERIOD_S, LINE_PERIOD_S = 0.2, 15.0
BAR_WIDTH = 24
STATUS_WORDS = {
    EpisodeStatus.SUCCEEDED: "succeeded",
    EpisodeStatus.FAILED: "failed",
    EpisodeStatus.TIMED_OUT: "timed out",
    EpisodeStatus.BROKEN: "broken",
    EpisodeStatus.INVALID: "invalid",
}


class Progress:
    """Counts episodes and displays the counts.

    Args:
        total: Number of episodes of the experiment.
        finished: Number of episodes that ended before this run.
        stream: Stream of the display.
        clock: Clock [s].
    """

    def __init__(self, total: int, finished: int, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        self._total, self._before, self._stream, self._clock = total, finished, stream, clock
        self._counts: Counter[EpisodeStatus] = Counter()
        self._start = self._shown = clock()
        self._is_terminal = stream.isatty()

    @property
    def ended_count(self) -> int:
        """Returns the number of episodes that ended in this run."""
        return sum(self._counts.values())

    def add(self, record: EpisodeRecord) -> None:
        """Counts an ended episode; reports broken and invalid episodes immediately."""
        self._counts[record.status] += 1
        episode = f"episode {record.spec.number} ({record.spec.key})"
        if record.status in (EpisodeStatus.BROKEN, EpisodeStatus.INVALID):
            self._write_line(f"{episode} is {STATUS_WORDS[record.status]}: {record.cause}")
        elif record.snapshot.get(EARLIER_TRIES):
            self._write_line(
                f"{episode} was repeated after attempts without a record: {'; '.join(record.snapshot[EARLIER_TRIES])}"
            )
        self.show()

    def show(self, *, now: bool = False) -> None:
        """Displays the counts if the period has passed.

        Args:
            now: Whether to ignore the period.
        """
        time_s = self._clock()
        period_s = BAR_PERIOD_S if self._is_terminal else LINE_PERIOD_S
        if not now and time_s - self._shown < period_s:
            return
        self._shown = time_s
        if self._is_terminal:
            self._stream.write(f"\r{self._bar_text()} {self.text()}"[: _columns(self._stream)] + "\033[K")
        else:
            self._stream.write(f"{self.text()}\n")
        self._stream.flush()

    def end(self) -> None:
        """Displays the final counts."""
        self.show(now=True)
        if self._is_terminal:
            self._stream.write("\n")
            self._stream.flush()

    def text(self) -> str:
        """Returns the counts and the remaining time as text."""
        ended = self._before + self.ended_count
        counts = ", ".join(f"{self._counts[status]} {word}" for status, word in STATUS_WORDS.items())
        before = f" ({self._before} before)" if self._before else ""
        return f"{ended} of {self._total} episodes{before}: {counts}; {self._remaining_time(self._total - ended)}"

    def _remaining_time(self, remaining: int) -> str:
        if remaining <= 0:
            return "done"
        if self.ended_count == 0:
            return "remaining time unknown"
        seconds = (self._clock() - self._start) / self.ended_count * remaining
        hours, rest = divmod(round(seconds), 3600)
        return f"about {hours}:{rest // 60:02}:{rest % 60:02} remaining"

    def _bar_text(self) -> str:
        filled = BAR_WIDTH * (self._before + self.ended_count) // max(self._total, 1)
        return f"[{'#' * filled}{'.' * (BAR_WIDTH - filled)}]"

    def _write_line(self, text: str) -> None:
        self._stream.write(f"\r\033[K{text}\n" if self._is_terminal else f"{text}\n")


def _columns(stream: TextIO) -> int:
    try:
        return max(os.get_terminal_size(stream.fileno()).columns - 1, 20)
    except OSError:
        return 79
