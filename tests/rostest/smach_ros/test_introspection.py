# SPDX-License-Identifier: BSD-3-Clause
"""A running machine as a viewer sees it, and the commands of a viewer."""

from __future__ import annotations

import base64
import os
import pickle
import subprocess
import sys
import threading
import time

import pytest
import rospy
from geometry_msgs.msg import Point
from smach_msgs.msg import SmachContainerInitialStatusCmd, SmachContainerStatus, SmachContainerStructure

import smach

pytestmark = pytest.mark.usefixtures("ros_session")


class Stay(smach.State):
    """Runs until it is allowed to continue."""

    def __init__(self) -> None:
        super().__init__(["done"], ["speed"])
        self.go = threading.Event()

    def execute(self, userdata):
        self.go.wait(120.0)
        return "done"


def pick_like():
    """Answers a machine with a nested and a concurrent one in it, and its states."""
    states = {name: Stay() for name in ("SELECT", "PLAN_A", "PLAN_B", "CLOSE", "LIFT")}
    root = smach.StateMachine(["done"])
    root.userdata.speed = 0.5
    root.userdata.place = Point(1.0, 2.0, 3.0)
    root.userdata.commander = threading.Lock()
    plan = smach.Concurrence(["done"], "done")
    with plan:
        smach.Concurrence.add("PLAN_A", states["PLAN_A"])
        smach.Concurrence.add("PLAN_B", states["PLAN_B"])
    grasp = smach.StateMachine(["done"])
    with grasp:
        smach.StateMachine.add("CLOSE", states["CLOSE"], {"done": "LIFT"})
        smach.StateMachine.add("LIFT", states["LIFT"])
    with root:
        smach.StateMachine.add("SELECT", states["SELECT"], {"done": "PLAN"})
        smach.StateMachine.add("PLAN", plan, {"done": "GRASP"})
        smach.StateMachine.add("GRASP", grasp)
    return root, states


class Viewer:
    """Keeps the last status and structure of each container, as a viewer does."""

    def __init__(self, server: str) -> None:
        self.status: dict[str, SmachContainerStatus] = {}
        self.structure: dict[str, SmachContainerStructure] = {}
        self._subscribers = [
            rospy.Subscriber(server + "/smach/container_status", SmachContainerStatus, self._on_status),
            rospy.Subscriber(server + "/smach/container_structure", SmachContainerStructure, self._on_structure),
        ]

    def _on_status(self, message):
        self.status[message.path] = message

    def _on_structure(self, message):
        self.structure[message.path] = message

    def sees(self, path, active, timeout_s=30.0):
        """Waits until a container has these active states."""
        return until(lambda: path in self.status and sorted(self.status[path].active_states) == active, timeout_s)


def until(condition, timeout_s=30.0):
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def test_a_viewer_follows_a_nested_and_concurrent_machine(monkeypatch):
    from smach_ros import IntrospectionClient, IntrospectionServer, introspection

    monkeypatch.setattr(introspection, "UPDATE_PERIOD_S", 600.0)  # what is seen was sent because something happened
    root, states = pick_like()
    server = IntrospectionServer("/pick", root, "/PICK")
    server.start()
    thread = threading.Thread(target=root.execute)
    thread.start()
    viewer = Viewer("/pick")
    assert viewer.sees("/PICK", ["SELECT"])  # a new viewer need not wait for the next round
    assert until(lambda: set(viewer.structure) == {"/PICK", "/PICK/PLAN", "/PICK/GRASP"})
    structure = viewer.structure["/PICK"]
    assert structure.children == ["SELECT", "PLAN", "GRASP"]
    edges = zip(structure.internal_outcomes, structure.outcomes_from, structure.outcomes_to, strict=True)
    assert list(edges) == [("done", "SELECT", "PLAN"), ("done", "PLAN", "GRASP"), ("done", "GRASP", "done")]
    assert structure.container_outcomes == ["done"]
    values = pickle.loads(base64.b64decode(viewer.status["/PICK"].local_data))  # as the public viewer reads it
    assert values["speed"] == 0.5
    assert values["place"] == Point(1.0, 2.0, 3.0)
    assert values["commander"] == "<_thread.lock>"
    states["SELECT"].go.set()
    assert viewer.sees("/PICK", ["PLAN"])
    assert viewer.sees("/PICK/PLAN", ["PLAN_A", "PLAN_B"])
    states["PLAN_A"].go.set()
    assert viewer.sees("/PICK/PLAN", ["PLAN_B"])
    states["PLAN_B"].go.set()
    assert viewer.sees("/PICK", ["GRASP"])
    assert viewer.sees("/PICK/GRASP", ["CLOSE"])
    assert "/pick" in IntrospectionClient().get_servers()
    states["CLOSE"].go.set()
    assert viewer.sees("/PICK/GRASP", ["LIFT"])
    states["LIFT"].go.set()
    thread.join(30.0)
    assert viewer.sees("/PICK", [])
    server.stop()
    server.stop()
    assert until(lambda: "/pick" not in IntrospectionClient().get_servers())


def test_a_viewer_can_choose_the_initial_state_and_userdata():
    from smach_ros import IntrospectionClient, IntrospectionServer

    root, _ = pick_like()
    server = IntrospectionServer("/choose", root, "/")
    server.start()
    userdata = smach.UserData()
    userdata.speed = 0.25
    client = IntrospectionClient()
    assert client.set_initial_state("/choose", "/GRASP", ["LIFT"], userdata, rospy.Duration(30.0)) is True
    assert root["GRASP"].get_initial_states() == ["LIFT"]
    assert root["GRASP"].userdata.speed == 0.25
    assert client.set_initial_state("/choose", "/GRASP", ["NOWHERE"], None, rospy.Duration(0.5)) is False
    assert root["GRASP"].get_initial_states() == ["LIFT"]
    server.stop()


def test_a_command_never_runs_code_and_a_bad_one_changes_nothing(tmp_path):
    from smach_ros import IntrospectionServer

    class Trap:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "sprung"),)

    root, _ = pick_like()
    server = IntrospectionServer("/trap", root, "/T")
    server.start()
    publisher = rospy.Publisher("/trap/smach/container_init", SmachContainerInitialStatusCmd, queue_size=10)
    assert until(lambda: publisher.get_num_connections() == 1)
    for data in (base64.b64encode(pickle.dumps({"x": Trap()})).decode(), "no base64", base64.b64encode(b"xx").decode()):
        publisher.publish("/T", ["GRASP"], data)
    publisher.publish("/T", ["SELECT", "GRASP"], "")  # a machine starts in one state
    publisher.publish("/T", ["PLAN"], "")
    assert until(lambda: root.get_initial_states() == ["PLAN"])
    assert not (tmp_path / "sprung").exists()
    server.stop()


def test_wrong_arguments_of_introspection_are_refused():
    from smach_ros import IntrospectionClient, IntrospectionServer
    from smach_ros.userdata_wire import UserdataError

    with pytest.raises(smach.InvalidStateError, match="needs a container"):
        IntrospectionServer("/x", Stay(), "/X")
    with pytest.raises(smach.InvalidStateError, match="must begin with '/'"):
        IntrospectionServer("/x", smach.StateMachine(["done"]), "X")
    userdata = smach.UserData()
    userdata.lock = threading.Lock()
    with pytest.raises(UserdataError, match="'lock' is a lock"):
        IntrospectionClient().set_initial_state("/x", "/X", ["A"], userdata)


PROGRAM = """
import threading, sys, rospy, smach, smach_ros
class Motion(smach.State):
    def __init__(self):
        super().__init__(["done", "stopped"])
        self.stop, self.begun = threading.Event(), threading.Event()
    def request_preempt(self):
        super().request_preempt()
        self.stop.set()
    def execute(self, userdata):
        self.begun.set()
        self.stop.wait(60.0)
        rospy.loginfo("stopped before the shutdown")
        print("stopped while shut down: %s" % rospy.is_shutdown(), flush=True)
        self.service_preempt()
        return "stopped"
rospy.init_node("mover", disable_signals=True)
machine = smach.StateMachine(["done", "stopped"])
with machine:
    motion = Motion()
    smach.StateMachine.add("MOVE", motion)
smach_ros.set_preempt_handler(machine)
assert smach.loginfo is rospy.loginfo
thread = threading.Thread(target=machine.execute)
thread.start()
assert motion.begun.wait(30.0)
rospy.signal_shutdown("test")
assert smach.is_shutdown()
thread.join(30.0)
"""


def test_a_shutdown_stops_the_machine_first(ros_session):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=ros_session.env, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "stopped while shut down: False" in done.stdout
