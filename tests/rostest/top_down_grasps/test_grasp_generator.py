# SPDX-License-Identifier: BSD-3-Clause
"""The grasp generator stores ranked grasps of what appears and signals it, or says why there is none."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest
import rospy
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from modular_framework_core import srv

sys.path.insert(0, str(Path(__file__).parents[1] / "modular_framework_core"))
from fake_move_group import FakeMoveGroup  # noqa: E402

LAUNCH = """<launch>
  <param name="arm_group_name" value="arm"/>
  <rosparam ns="top_down_grasp_generator">{gripper_joint: f, scene_timeout: 1.0, max_grasps: 3}</rosparam>
  <node name="managers" pkg="modular_framework_core" type="managers" required="true" output="screen"/>
  <node name="top_down_grasp_generator" pkg="top_down_grasps" type="top_down_grasp_generator" required="true"
        output="screen"/></launch>"""


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
def scene(ros_session, ros_launch) -> FakeMoveGroup:
    fake = FakeMoveGroup()
    fake.reach = 0.5
    fake.watcher = Watcher()
    fake.session = ros_launch(LAUNCH)
    return fake


def get_grasp():
    proxy = rospy.ServiceProxy("get_grasp", srv.GetStandardisedGrasp)
    proxy.wait_for_service(60)
    return proxy("")


def generate() -> tuple[bool, str]:
    answer = rospy.ServiceProxy("top_down_grasp_generator/generate", Trigger)()
    return answer.success, answer.message


def test_an_empty_scene_is_signalled_as_failure_that_names_the_crop_box_and_what_there_is(scene) -> None:
    scene.add_box("table__link", (1.0, 1.0, 0.8), (0.0, 0.5, 0.44))
    signal, reason = scene.watcher.wait(1)
    assert not signal
    assert "crop box x -0.345 to 0.355" in reason
    assert "table__link at (0.00, 0.50, 0.44)" in reason


def test_an_object_that_appears_gives_ranked_grasps_and_a_signal(scene) -> None:
    scene.add_box("box__link", (0.04, 0.07, 0.1), (0.05, 0.5, 0.89))
    signal, reason = scene.watcher.wait(2)
    assert signal, reason
    grasps = [get_grasp() for _ in range(4)]
    assert [answer.success for answer in grasps] == [True, True, True, False]
    best = grasps[0].grasp_message
    assert best.object_id == "box__link"
    assert best.grasp_quality >= grasps[1].grasp_message.grasp_quality >= grasps[2].grasp_message.grasp_quality
    assert best.grasp.pose.header.frame_id == "world"
    place, above, lifted = (state.pose.pose.position for state in (best.grasp, best.pregrasp, best.postgrasp))
    assert (place.x, place.y) == pytest.approx((0.05, 0.5), abs=1e-6)
    assert above.z - place.z == pytest.approx(0.10)
    assert lifted.z - place.z == pytest.approx(0.15)
    assert best.pregrasp.posture.name == ["f"]
    assert best.grasp.posture.position[0] == pytest.approx(0.055)
    opening = 0.12 - 0.01 - 2 * best.pregrasp.posture.position[0]
    assert opening == pytest.approx(0.04 + 2 * 0.012, abs=1e-3)


def stored() -> tuple[list[str], int]:
    answer = rospy.ServiceProxy("list_grasps", srv.ListMessages)()
    return answer.names, answer.anonymous


def test_new_grasps_replace_the_ones_that_are_left(scene) -> None:
    assert generate()[0]
    assert generate()[0]
    assert stored() == ([], 3)
    assert get_grasp().success
    for name in ("top_down_grasp_generator/refresh", "refresh_grasps"):
        assert rospy.ServiceProxy(name, Trigger)().message.startswith("nothing has moved")
    assert stored() == ([], 2)
    scene.objects[-1].pose.position.x += 0.03
    answer = rospy.ServiceProxy("top_down_grasp_generator/refresh", Trigger)()
    assert answer.success, answer.message
    assert stored() == ([], 3)
    assert get_grasp().grasp_message.grasp.pose.pose.position.x == pytest.approx(0.08, abs=1e-6)


def test_on_demand_the_reason_reports_what_is_wrong(scene) -> None:
    scene.reach = -1.0
    success, text = generate()
    assert not success
    assert "no grasp of ['box__link'] is reachable" in text
    assert "out of reach" in text
    scene.reach, scene.blocked = 0.5, 0.1
    assert "'palm' with 'wall'" in generate()[1]
    scene.blocked = 1.0
    rospy.set_param("top_down_grasp_generator/object_name", "teapot")
    assert "no object 'teapot'" in generate()[1]
    rospy.set_param("top_down_grasp_generator/object_name", "table")
    assert "can be grasped from above" in generate()[1]


def test_grasps_that_the_arm_cannot_approach_with_the_fingers_as_they_are_are_left_out(scene) -> None:
    rospy.set_param("top_down_grasp_generator/object_name", "box")
    scene.blocked_for_current_fingers = 0.0
    success, text = generate()
    scene.blocked_for_current_fingers = 1.0
    assert not success
    assert "with the fingers as they are now, the arm is in collision there ('palm' with 'wall')" in text
    assert generate()[0]


def test_a_wrong_parameter_is_named_and_the_node_lives_on(scene) -> None:
    rospy.set_param("top_down_grasp_generator/object_name", "box")
    rospy.set_param("top_down_grasp_generator/approach_distance", "far")
    assert generate()[0]
    assert "approach_distance" in scene.session.log()
    assert scene.session.alive()


def test_grasps_can_be_stored_under_names(scene) -> None:
    rospy.set_param("top_down_grasp_generator/name_prefix", "box_")
    assert generate()[0]
    assert stored() == (["box_1", "box_2", "box_3"], 0)
    rospy.set_param("top_down_grasp_generator/max_grasps", 2)
    assert generate()[0]
    assert stored() == (["box_1", "box_2"], 0)
    rospy.set_param("top_down_grasp_generator/max_grasps", 3)
    assert generate()[0]
    proxy = rospy.ServiceProxy("get_grasp", srv.GetStandardisedGrasp)
    assert proxy("box_1").grasp_message.grasp_id == "box_1"
    assert proxy("box_3").success


def test_an_object_that_comes_back_under_its_name_gives_grasps_again(scene) -> None:
    rospy.set_param("top_down_grasp_generator/object_name", "")
    rospy.set_param("top_down_grasp_generator/name_prefix", "again_")
    scene.objects = [item for item in scene.objects if item.id != "box__link"]
    before, deadline = scene.scene_requests, time.monotonic() + 60.0
    while (
        scene.scene_requests < before + 4
    ):  # what was signalled of the box before has been heard, and that it is gone was seen
        assert time.monotonic() < deadline, "the generator does not look at the scene any more"
        time.sleep(0.02)
    count = len(scene.watcher.signals)
    scene.add_box("box__link", (0.04, 0.07, 0.1), (0.1, 0.45, 0.89))
    signal, reason = scene.watcher.wait(count + 1)
    assert signal, reason
    grasp = rospy.ServiceProxy("get_grasp", srv.GetStandardisedGrasp)("again_1").grasp_message
    assert grasp.grasp.pose.pose.position.x == pytest.approx(0.1, abs=1e-6)
