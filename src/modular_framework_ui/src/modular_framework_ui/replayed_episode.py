# SPDX-License-Identifier: BSD-3-Clause
"""An episode on the page: the model of its task, and its recorded world."""

from __future__ import annotations

from modular_framework_core.task_constructor import machine_graph
from modular_framework_core.task_constructor.machine_graph import GraphError
from modular_framework_simulation.viewer.web_server import AddressError
from modular_framework_ui.page_source import PageSource, Query
from modular_framework_ui.recorded_episode import RecordedEpisode
from modular_framework_ui.recorded_task import ReplayError
from modular_framework_ui.recorded_world import RecordedWorld
from modular_framework_ui.replay import replayed_model
from modular_framework_ui.task_state import TaskChanges


class ReplayedEpisode:
    """The model of a record with the drawing of its state machine, and the viewer of its world.

    Args:
        episode: Record of the episode.
        host: Address of the viewer.

    Raises:
        ReplayError: The state machine cannot be drawn, or the viewer cannot be served.
    """

    def __init__(self, episode: RecordedEpisode, host: str) -> None:
        self._episode = episode
        self._model = replayed_model(episode)
        frame = self._model.frame()
        try:
            if frame is not None:
                self._model.note_drawing(machine_graph.render(machine_graph.draw(frame).source, "svg").decode())
            self._world = (
                None if episode.scene is None else RecordedWorld(episode.scene, host, self._scene_time_s(None))
            )
        except (GraphError, AddressError) as error:
            raise ReplayError(str(error)) from error
        if self._world is not None:
            self._model.note_viewer(self._world.address)

    def changes_since(self, revision: int) -> TaskChanges:
        """Returns the changes after a revision; revision 0 returns the whole state."""
        return self._model.changes_since(revision)

    def show(self, time_s: float | None) -> None:
        """Shows the recorded world at a time [s since the start of the task]; None for the end of the task."""
        if self._world is not None:
            self._world.show(self._scene_time_s(time_s))

    def close(self) -> None:
        """Ends the viewer; may be called twice."""
        if self._world is not None:
            self._world.close()

    def _scene_time_s(self, time_s: float | None) -> float:
        return self._episode.to_recording_time(self._episode.task.ended_s if time_s is None else time_s)


class EpisodeSource(PageSource):
    """A single record, whatever the query.

    Args:
        episode: The record.
    """

    def __init__(self, episode: ReplayedEpisode) -> None:
        super().__init__(episode.changes_since)
        self._episode = episode

    def show(self, query: Query, time_s: float | None) -> None:
        """Shows the recorded world at a time [s since the start of the task]; None for the end of the task."""
        self._episode.show(time_s)

    def close(self) -> None:
        """Ends the viewer; may be called twice."""
        self._episode.close()
