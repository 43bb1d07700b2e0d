# SPDX-License-Identifier: BSD-3-Clause
"""ROS node of the page that shows a running task, or the record of an episode, in a browser."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import rosgraph
import rospkg
import rospy

from modular_framework_core.task_constructor import machine_graph
from modular_framework_core.task_constructor.machine_graph import GraphError, MachineFrame
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.node_handle import ParameterError
from modular_framework_simulation.viewer.web_server import AddressError, free_port
from modular_framework_ui.page_server import PageServer
from modular_framework_ui.page_source import PageSource
from modular_framework_ui.ros_task_topics import TaskTopics
from modular_framework_ui.task_model import TaskModel

_NODE = "page"
_SEARCH_PERIOD_S = 0.5
_LOG_PERIOD_S = 10.0


class PageNode:
    """Records the task from the start of the node, so that a page can be opened at any time.

    Parameters: see `parameters/page.yaml`. Subscribers: see `TaskTopics`.

    Args:
        folder: Folder with the files of the page.
        host: Address of the web server.
        port: Unused port.
    """

    def __init__(self, folder: Path, host: str, port: int) -> None:
        self._changed = threading.Event()
        self._model = TaskModel(time.monotonic, self._note_change)
        self._server = PageServer(folder, PageSource(self._model.changes_since), host, port)
        self._frame: MachineFrame | None = None

    @property
    def address(self) -> str:
        """Returns the URL of the page."""
        return self._server.address

    def run(self) -> None:
        """Serves the page until ROS shuts down.

        Raises:
            OSError: The server cannot listen at its address.
        """
        self._server.start()
        rospy.loginfo("page: open %s in a browser", self.address)
        topics = TaskTopics(self._model)
        threading.Thread(target=self._draw_always, name="drawing", daemon=True).start()
        ended = threading.Event()
        rospy.on_shutdown(ended.set)
        while not ended.wait(_SEARCH_PERIOD_S):
            try:
                topics.search()
            except (rosgraph.MasterException, OSError) as error:
                rospy.logwarn_throttle(_LOG_PERIOD_S, f"the ROS master does not respond: {error}")
        self._server.close()

    def _note_change(self) -> None:
        self._changed.set()
        self._server.notify()

    def _draw_always(self) -> None:
        """Draws the changed state machine; runs in a separate thread, because Graphviz takes up to a second."""
        while True:
            self._changed.wait()
            self._changed.clear()
            frame = self._model.frame()
            if frame == self._frame:
                continue
            self._frame = frame
            if frame is None:
                continue
            try:
                svg = machine_graph.render(machine_graph.draw(frame).source, "svg").decode()
            except GraphError as error:
                rospy.logerr(f"the state machine is not drawn: {error}")
            else:
                self._model.note_drawing(svg)


def main() -> int:
    """Runs the node, or with `--replay RECORD` the page of a record or of an experiment.

    Returns:
        Exit code: 0 after a regular shutdown, 1 if the page cannot be served, 2 if the record cannot be replayed.
    """
    web_folder = Path(rospkg.RosPack().get_path("modular_framework_ui")) / "web"
    if arguments := rospy.myargv()[1:]:
        from modular_framework_ui import replay_command  # reads tables, and its import takes seconds

        return replay_command.main(arguments, web_folder)
    # With real time, the page keeps running while simulated time is paused.
    rospy.init_node(_NODE, disable_rostime=True)
    read = DeclaredParameters("modular_framework_ui", _NODE).values
    try:
        host, first_port = read("~address", "~port")
        port = free_port(host, first_port)
        if port != first_port:
            rospy.logwarn("port %s is in use; the page uses port %d", first_port, port)
        PageNode(web_folder, host, port).run()
    except (AddressError, ParameterError, OSError) as error:
        rospy.logfatal("the page cannot start: %s", error)
        return 1
    return 0
