# SPDX-License-Identifier: BSD-3-Clause
"""What every grasp generator does: it stores ranked grasps of what appears and signals it, or says why there is none.

A suite imports these tests and names its method: `METHOD = Method(...)`, `method = pytest.fixture(lambda: METHOD)`.
"""

from __future__ import annotations

import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import rospy
from scipy.spatial.transform import Rotation
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from modular_framework_core import srv
from modular_framework_core.msg import StandardisedGrasp

sys.path.insert(0, str(Path(__file__).parent / "modular_framework_core"))
from fake_move_group import FakeMoveGroup  # noqa: E402

from modular_framework_testing.ros_session import until  # noqa: E402

BOX_SIZE = (0.04, 0.07, 0.1)
APPROACH_M, LIFT_M = 0.10, 0.15
HAND_M = 0.12  # the grasp frame is nearer to what the pads hold than this


@dataclass(frozen=True)
class Method:
    """A method under test.

    Attributes:
        package: Its package.
        node: Its node.
        manner: How it says that it grasps.
    """

    package: str
    node: str
    manner: str

    @property
    def launch(self) -> str:
        return f"""<launch>
  <param name="arm_group_name" value="arm"/>
  <rosparam ns="{self.node}">{{gripper_joint: f, scene_timeout: 1.0, max_grasps: 3}}</rosparam>
  <node name="managers" pkg="modular_framework_core" type="managers" required="true" output="screen"/>
  <node name="{self.node}" pkg="{self.package}" type="{self.node}" required="true" output="screen"/></launch>"""

    def set(self, name: str, value: object) -> None:
        rospy.set_param(f"{self.node}/{name}", value)

    def generate(self) -> tuple[bool, str]:
        answer = rospy.ServiceProxy(f"{self.node}/generate", Trigger)()
        return answer.success, answer.message


class Watcher:
    """Remembers the latest signal and its reason."""

    def __init__(self) -> None:
        self.signals: list[bool] = []
        self.reasons: list[str] = []
        rospy.Subscriber("grasp_generated/reason", String, lambda message: self.reasons.append(message.data))
        rospy.Subscriber("grasp_generated", Bool, lambda message: self.signals.append(message.data))

    def wait(self, count: int, timeout_s: float = 90.0) -> tuple[bool, str]:
        deadline = time.monotonic() + timeout_s
        while len(self.signals) < count or len(self.reasons) < count:
            assert time.monotonic() < deadline, f"{self.signals} {self.reasons}"
            time.sleep(0.02)
        return self.signals[count - 1], self.reasons[count - 1]


@pytest.fixture(scope="module")
def scene(ros_session, ros_launch, method: Method) -> FakeMoveGroup:
    fake = FakeMoveGroup()
    fake.reach = 0.5
    fake.watcher = Watcher()
    fake.session = ros_launch(method.launch)
    return fake


def get_grasp():
    proxy = rospy.ServiceProxy("get_grasp", srv.GetStandardisedGrasp)
    proxy.wait_for_service(60)
    return proxy("")


def test_an_empty_scene_is_signalled_as_failure_that_names_the_crop_box_and_what_there_is(scene) -> None:
    scene.add_box("table__link", (1.0, 1.0, 0.8), (0.0, 0.5, 0.44))
    signal, reason = scene.watcher.wait(1)
    assert not signal
    assert "crop box x -0.345 to 0.355" in reason
    assert "table__link at (0.00, 0.50, 0.44)" in reason


def test_an_object_that_appears_gives_ranked_grasps_and_a_signal(scene, method: Method) -> None:
    scene.add_box("box__link", BOX_SIZE, (0.05, 0.5, 0.89))
    signal, reason = scene.watcher.wait(2)
    assert signal, reason
    grasps = [get_grasp() for _ in range(4)]
    assert [answer.success for answer in grasps] == [True, True, True, False]
    best = grasps[0].grasp_message
    assert best.object_id == "box__link"
    assert best.grasp_quality >= grasps[1].grasp_message.grasp_quality >= grasps[2].grasp_message.grasp_quality
    assert best.grasp.pose.header.frame_id == "world"
    assert_between_the_pads(best, 0.05, 0.5)
    assert best.pregrasp.posture.name == ["f"]
    assert best.grasp.posture.position[0] == pytest.approx(0.055)
    assert_advances_and_lifts(best)


def assert_advances_and_lifts(grasp: StandardisedGrasp) -> None:
    """The hand advances along its approach, and is then lifted as it is."""
    before, at, after = (pose_of(stage) for stage in (grasp.pregrasp, grasp.grasp, grasp.postgrasp))
    approach = at[1].as_matrix()[:, 2]
    assert at[0] - before[0] == pytest.approx(APPROACH_M * approach, abs=1e-9)
    assert after[0] - at[0] == pytest.approx([0.0, 0.0, LIFT_M], abs=1e-9)
    assert all((at[1].inv() * other[1]).magnitude() < 1e-9 for other in (before, after))


def pose_of(stage) -> tuple[np.ndarray, Rotation]:
    pose = stage.pose.pose
    at, turn = pose.position, pose.orientation
    return np.array([at.x, at.y, at.z]), Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])


def assert_between_the_pads(grasp: StandardisedGrasp, x: float, y: float) -> None:
    """What is in front of the hand is the object that stands there."""
    position, orientation = pose_of(grasp.grasp)
    held = position + orientation.as_matrix()[:, 2] * np.linspace(-HAND_M, HAND_M, 49)[:, None]
    inside = np.abs(held - [x, y, 0.89]) <= np.array(BOX_SIZE) / 2 + 0.005
    assert inside.all(axis=1).any(), (position, orientation.as_matrix())


def stored() -> tuple[list[str], int]:
    answer = rospy.ServiceProxy("list_grasps", srv.ListMessages)()
    return answer.names, answer.anonymous


def test_new_grasps_replace_the_ones_that_are_left(scene, method: Method) -> None:
    assert method.generate()[0]
    assert method.generate()[0]
    assert stored() == ([], 3)
    assert get_grasp().success
    for name in (f"{method.node}/refresh", "refresh_grasps"):
        assert rospy.ServiceProxy(name, Trigger)().message.startswith("nothing has moved")
    assert stored() == ([], 2)
    scene.objects[-1].pose.position.x += 0.03
    answer = rospy.ServiceProxy(f"{method.node}/refresh", Trigger)()
    assert answer.success, answer.message
    assert stored() == ([], 3)
    assert_between_the_pads(get_grasp().grasp_message, 0.08, 0.5)


def renew() -> tuple[bool, str]:
    answer = rospy.ServiceProxy("grasp_generated/renew", Trigger)()
    return answer.success, answer.message


def test_a_task_begins_with_all_grasps_however_many_the_task_before_took(scene, method: Method) -> None:
    assert method.generate()[0]
    generated = len(scene.watcher.reasons)
    assert renew()[1].startswith("nothing has moved"), "a complete set stays"
    assert get_grasp().success
    assert renew()[0]
    assert stored() == ([], 3)
    while get_grasp().success:
        pass
    assert renew()[0]
    assert stored() == ([], 3)
    scene.watcher.wait(generated + 2)


def test_grasps_that_were_all_handed_out_are_generated_again_before_the_next_attempt(scene, method: Method) -> None:
    assert method.generate()[0]
    while get_grasp().success:
        pass
    answer = rospy.ServiceProxy("refresh_grasps", Trigger)()
    assert answer.success, answer.message
    assert "nothing has moved" not in answer.message
    assert stored() == ([], 3)


def test_a_task_that_begins_before_its_object_is_there_waits_for_it(scene, method: Method) -> None:
    box = scene.objects.pop()
    answers: list[tuple[bool, str]] = []
    method.set("scene_timeout", 60.0)
    task = threading.Thread(target=lambda: answers.append(renew()))
    task.start()
    before = scene.scene_requests
    until(lambda: scene.scene_requests > before + 1, "the generator looks for the object")
    assert not answers
    scene.objects.append(box)
    task.join(60.0)
    method.set("scene_timeout", 1.0)
    assert answers
    assert answers[0][0], answers


def test_on_demand_the_reason_reports_what_is_wrong(scene, method: Method) -> None:
    scene.reach = -1.0
    success, text = method.generate()
    assert not success
    assert "no grasp of ['box__link'] is reachable" in text
    assert "out of reach" in text
    scene.reach, scene.blocked = 0.5, 0.1
    assert "'palm' with 'wall'" in method.generate()[1]
    scene.blocked = 1.0
    method.set("object_name", "teapot")
    assert "no object 'teapot'" in method.generate()[1]
    method.set("object_name", "table")
    assert f"can be grasped {method.manner}" in method.generate()[1]


def test_grasps_that_the_arm_cannot_approach_with_the_fingers_as_they_are_are_left_out(scene, method: Method) -> None:
    method.set("object_name", "box")
    scene.blocked_for_current_fingers = -1.0
    success, text = method.generate()
    scene.blocked_for_current_fingers = 1.0
    assert not success
    assert "with the fingers as they are now, the arm is in collision there ('palm' with 'wall')" in text
    assert method.generate()[0]


def test_a_wrong_parameter_is_refused_by_name_until_it_is_corrected(scene, method: Method) -> None:
    method.set("object_name", "box")
    method.set("approach_distance", "far")
    success, text = method.generate()
    assert not success and "approach_distance" in text and "'far'" in text and "at least 0.01" in text
    method.set("approach_distance", APPROACH_M)
    assert method.generate()[0], "the node lives on, and does not run a default meanwhile"


def test_grasps_can_be_stored_under_names(scene, method: Method) -> None:
    method.set("name_prefix", "box_")
    assert method.generate()[0]
    assert stored() == (["box_1", "box_2", "box_3"], 0)
    method.set("max_grasps", 2)
    assert method.generate()[0]
    assert stored() == (["box_1", "box_2"], 0)
    method.set("max_grasps", 3)
    assert method.generate()[0]
    proxy = rospy.ServiceProxy("get_grasp", srv.GetStandardisedGrasp)
    assert proxy("box_1").grasp_message.grasp_id == "box_1"
    assert proxy("box_3").success


def test_an_object_that_comes_back_under_its_name_gives_grasps_again(scene, method: Method) -> None:
    method.set("object_name", "")
    method.set("name_prefix", "again_")
    scene.objects = [item for item in scene.objects if item.id != "box__link"]
    before, deadline = scene.scene_requests, time.monotonic() + 60.0
    while (
        scene.scene_requests < before + 4
    ):  # what was signalled of the box before has been heard, and that it is gone was seen
        assert time.monotonic() < deadline, "the generator does not look at the scene any more"
        time.sleep(0.02)
    count = len(scene.watcher.signals)
    scene.add_box("box__link", BOX_SIZE, (0.1, 0.45, 0.89))
    signal, reason = scene.watcher.wait(count + 1)
    assert signal, reason
    grasp = rospy.ServiceProxy("get_grasp", srv.GetStandardisedGrasp)("again_1").grasp_message
    assert_between_the_pads(grasp, 0.1, 0.45)
