# SPDX-License-Identifier: BSD-3-Clause
"""Queue of episodes that assigns episodes with a common stack to the same worker."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from modular_framework_benchmark.experiments.design import stack_of
from modular_framework_benchmark.records.episode import EpisodeSpec


class EpisodeQueue:
    """Queue of the remaining episodes.

    Args:
        episodes: Episodes in the order of the run.
    """

    def __init__(self, episodes: Iterable[EpisodeSpec]) -> None:
        self._groups: list[tuple[str, deque[EpisodeSpec]]] = []
        for spec in episodes:
            stack = stack_of(spec.settings)
            if not self._groups or self._groups[-1][0] != stack:
                self._groups.append((stack, deque()))
            self._groups[-1][1].append(spec)
        self._groups.reverse()  # pop() removes the last element in constant time
        self._owned: dict[str, deque[EpisodeSpec]] = {}
        self._running: dict[str, str] = {}  # stack of each slot's latest episode

    def __len__(self) -> int:
        return sum(len(group) for _, group in self._groups) + sum(len(group) for group in self._owned.values())

    def next_for(self, slot: str, alone: bool = False) -> EpisodeSpec | None:
        """Returns the next episode for a slot, or None without an episode for it.

        A slot runs the episodes of one stack, then those of the next unassigned stack. Without an unassigned stack, it
        helps the slot with most remaining episodes. It leaves that slot the last episode if it would have to start
        another stack for it.

        Args:
            slot: Name of the slot.
            alone: Whether no other slot runs an episode, so that this slot takes any remaining episode.
        """
        own = self._owned.get(slot)
        if not own and self._groups:
            own = self._owned[slot] = self._groups.pop()[1]
        if not own:
            own = max(self._owned.values(), key=len, default=None)
            if not own or (len(own) == 1 and not alone and self._running.get(slot) != stack_of(own[0].settings)):
                return None
        spec = own.popleft()
        self._running[slot] = stack_of(spec.settings)
        return spec
