# SPDX-License-Identifier: BSD-3-Clause
"""Conformance suite of grasp generators, with what tasks and experiments require of every generator.

To use the suite, define in a test module a subclass of `GraspGeneratorConformance` whose name starts with Test, set its
attributes, and let rostest run the module with the fixtures of `modular_framework_testing.ros_fixtures`. The suite
starts the node of the generator beside the managers and a fake move_group, whose gripper slides along x and y.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import rospy
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from modular_framework_core import srv
from modular_framework_core.msg import StandardisedGrasp
from modular_framework_testing.grasping.fake_move_group import FakeMoveGroup
from modular_framework_testing.ros_session import RosSession, until

BOX_SIZE = (0.04, 0.07, 0.1)
"""Edge lengths of the object [m]."""
BOX_Z = 0.89
"""Height of the object's centre above the floor; the object stands on a table [m]."""
APPROACH_M, LIFT_M = 0.10, 0.15
"""Distances of the pregrasp and of the postgrasp from the grasp."""
HAND_M = 0.12
"""Maximum distance between the grasp frame and the held part of the object."""
GENERATION_TIMEOUT_S = 90.0


class Signals:
    """Signals of a generator and their reasons, in the order of their arrival."""

    def __init__(self) -> None:
        """Subscribes to the topics of all generators."""
        self.signals: list[bool] = []
        self.reasons: list[str] = []
        rospy.Subscriber("grasp_generated/reason", String, lambda message: self.reasons.append(message.data))
        rospy.Subscriber("grasp_generated", Bool, lambda message: self.signals.append(message.data))

    def wait(self, count: int) -> tuple[bool, str]:
        """Waits for a signal and returns it with its reason.

        Args:
            count: Number of the signal, from 1.
        """
        until(lambda: min(len(self.signals), len(self.reasons)) >= count, f"signal {count}", GENERATION_TIMEOUT_S)
        return self.signals[count - 1], self.reasons[count - 1]


def next_grasp(name: str = "") -> Any:
    """Returns the grasp of a name, or takes the best anonymous grasp, as the response of the manager of grasps."""
    proxy = rospy.ServiceProxy("get_grasp", srv.GetStandardisedGrasp)
    proxy.wait_for_service(60.0)
    return proxy(name)


def stored_grasps() -> tuple[list[str], int]:
    """Returns the names of the named grasps, and the number of anonymous grasps."""
    response = rospy.ServiceProxy("list_grasps", srv.ListMessages)()
    return response.names, response.anonymous


def renew_grasps() -> tuple[bool, str]:
    """Asks for a complete set of grasps, as a task does at its start; returns success and message."""
    response = rospy.ServiceProxy("grasp_generated/renew", Trigger)()
    return response.success, response.message


def assert_holds_box(grasp: StandardisedGrasp, x: float, y: float) -> None:
    """Asserts that the box is between the pads of the hand.

    Args:
        grasp: Grasp in the world frame.
        x: Position of the box along x [m].
        y: Position of the box along y [m].
    """
    position, orientation = _pose(grasp.grasp)
    held = position + orientation.as_matrix()[:, 2] * np.linspace(-HAND_M, HAND_M, 49)[:, None]
    inside = np.abs(held - [x, y, BOX_Z]) <= np.array(BOX_SIZE) / 2 + 0.005
    assert inside.all(axis=1).any(), (position, orientation.as_matrix())


def _pose(stage: Any) -> tuple[NDArray[np.float64], Rotation]:
    position, orientation = stage.pose.pose.position, stage.pose.pose.orientation
    return (
        np.array([position.x, position.y, position.z]),
        Rotation.from_quat([orientation.x, orientation.y, orientation.z, orientation.w]),
    )


class GraspGeneratorConformance:
    """Tests of one grasp generator. The tests run in their order, because the first two add the objects of the scene.

    Attributes:
        package: Package of the generator.
        node: Name and type of its node.
        manner: Phrase of the generator for its kind of grasps, such as "from above".
        scene: The fake move_group with the planning scene.
        signals: Signals of the generator.
    """

    package: str
    node: str
    manner: str
    scene: FakeMoveGroup
    signals: Signals

    @classmethod
    def prepare(cls) -> None:
        """Sets further parameters and starts sensors before the node starts; overridden by generators with sensors."""

    @pytest.fixture(scope="class", autouse=True)
    def launched_generator(
        self, request: pytest.FixtureRequest, ros_session: RosSession, ros_launch: Callable[..., RosSession]
    ) -> None:
        """Starts the generator, once for all tests.

        Args:
            request: Request of the fixture, with the class of the suite.
            ros_session: The master.
            ros_launch: Function that starts a launch file.
        """
        del ros_session  # this process is a node from here on
        suite = request.cls
        suite.scene, suite.signals = FakeMoveGroup(), Signals()
        suite.scene.reach = 0.5
        suite.prepare()
        ros_launch(
            f"""<launch>
  <param name="arm_group_name" value="arm"/>
  <rosparam ns="{suite.node}">{{gripper_joint: f, scene_timeout: 1.0, max_grasps: 3}}</rosparam>
  <node name="managers" pkg="modular_framework_core" type="managers" required="true" output="screen"/>
  <node name="{suite.node}" pkg="{suite.package}" type="{suite.node}" required="true" output="screen"/></launch>"""
        )

    @pytest.fixture(autouse=True)
    def restored_parameters(self) -> Iterator[None]:
        """Restores the parameters after each test."""
        self._previous: dict[str, Any] = {}
        yield
        for path, value in self._previous.items():
            if value is None:
                rospy.delete_param(path)
            else:
                rospy.set_param(path, value)

    def set_parameter(self, name: str, value: object) -> None:
        """Sets a private parameter of the generator for the present test.

        Args:
            name: Name of the parameter, which the generator reads at each generation.
            value: Value of the parameter.
        """
        path = f"{self.node}/{name}"
        self._previous.setdefault(path, rospy.get_param(path, None))
        rospy.set_param(path, value)

    def generate(self) -> tuple[bool, str]:
        """Lets the generator generate grasps; returns success and message."""
        response = rospy.ServiceProxy(f"{self.node}/generate", Trigger)()
        return response.success, response.message

    def test_an_empty_scene_is_a_failure_that_names_the_crop_box_and_the_objects(self) -> None:
        """The only object is a table below the crop box."""
        self.scene.add_box("table__link", (1.0, 1.0, 0.8), (0.0, 0.5, 0.44))
        success, reason = self.signals.wait(1)
        assert not success
        assert "crop box x -0.345 to 0.355" in reason
        assert "table__link at (0.00, 0.50, 0.44)" in reason

    def test_an_object_that_appears_gives_ranked_grasps_and_a_signal(self) -> None:
        """Each grasp holds the box, and its stages are on one line along the approach, then above the grasp."""
        self.scene.add_box("box__link", BOX_SIZE, (0.05, 0.5, BOX_Z))
        success, reason = self.signals.wait(2)
        assert success, reason
        responses = [next_grasp() for _ in range(4)]
        assert [response.success for response in responses] == [True, True, True, False]
        grasps = [response.grasp_message for response in responses[:3]]
        qualities = [grasp.grasp_quality for grasp in grasps]
        assert qualities == sorted(qualities, reverse=True)
        best = grasps[0]
        assert best.object_id == "box__link"
        assert best.grasp.pose.header.frame_id == "world"
        assert_holds_box(best, 0.05, 0.5)
        assert best.pregrasp.posture.name == ["f"]
        assert best.grasp.posture.position[0] == pytest.approx(0.055)
        before, at, after = (_pose(stage) for stage in (best.pregrasp, best.grasp, best.postgrasp))
        assert at[0] - before[0] == pytest.approx(APPROACH_M * at[1].as_matrix()[:, 2], abs=1e-9)
        assert after[0] - at[0] == pytest.approx([0.0, 0.0, LIFT_M], abs=1e-9)
        assert all((at[1].inv() * stage[1]).magnitude() < 1e-9 for stage in (before, after))

    def test_new_grasps_replace_old_grasps(self) -> None:
        """A refresh without a moved object keeps the grasps; after a motion of the object, there are new grasps."""
        assert self.generate()[0]
        assert self.generate()[0]
        assert stored_grasps() == ([], 3)
        assert next_grasp().success
        for name in (f"{self.node}/refresh", "refresh_grasps"):
            assert rospy.ServiceProxy(name, Trigger)().message.startswith("nothing has moved")
        assert stored_grasps() == ([], 2)
        self.scene.objects[-1].pose.position.x += 0.03
        response = rospy.ServiceProxy(f"{self.node}/refresh", Trigger)()
        assert response.success, response.message
        assert stored_grasps() == ([], 3)
        assert_holds_box(next_grasp().grasp_message, 0.08, 0.5)

    def test_a_task_begins_with_all_grasps_however_many_the_previous_task_took(self) -> None:
        """A complete set stays; an incomplete set is generated again, with a signal."""
        assert self.generate()[0]
        generated = len(self.signals.reasons)
        assert renew_grasps()[1].startswith("nothing has moved"), "a complete set stays"
        assert next_grasp().success
        assert renew_grasps()[0]
        assert stored_grasps() == ([], 3)
        while next_grasp().success:
            pass
        assert renew_grasps()[0]
        assert stored_grasps() == ([], 3)
        self.signals.wait(generated + 2)

    def test_a_refresh_generates_grasps_again_after_all_were_taken(self) -> None:
        """The task takes each grasp; the refresh before its next attempt generates them again."""
        assert self.generate()[0]
        while next_grasp().success:
            pass
        response = rospy.ServiceProxy("refresh_grasps", Trigger)()
        assert response.success, response.message
        assert "nothing has moved" not in response.message
        assert stored_grasps() == ([], 3)

    def test_a_task_that_begins_before_its_object_appears_waits_for_the_object(self) -> None:
        """The object appears after the generator has looked for it twice."""
        box = self.scene.objects.pop()
        responses: list[tuple[bool, str]] = []
        self.set_parameter("scene_timeout", 60.0)
        task = threading.Thread(target=lambda: responses.append(renew_grasps()))
        task.start()
        before = self.scene.scene_requests
        until(lambda: self.scene.scene_requests > before + 1, "the generator looks for the object")
        assert not responses
        self.scene.objects.append(box)
        task.join(60.0)
        assert responses
        assert responses[0][0], responses

    def test_a_failure_has_its_cause(self) -> None:
        """No pose is reachable, all are in collision, the object is unknown, or it cannot be grasped."""
        self.scene.reach = -1.0
        success, text = self.generate()
        assert not success
        assert "no grasp of ['box__link'] is reachable" in text
        assert "out of reach" in text
        self.scene.reach, self.scene.blocked = 0.5, 0.1
        assert "'palm' with 'wall'" in self.generate()[1]
        self.scene.blocked = 1.0
        self.set_parameter("object_name", "teapot")
        assert "no object 'teapot'" in self.generate()[1]
        self.set_parameter("object_name", "table")
        assert f"can be grasped {self.manner}" in self.generate()[1]

    def test_grasps_that_collide_with_the_present_finger_positions_are_omitted(self) -> None:
        """The arm moves to the pregrasp before the fingers open."""
        self.set_parameter("object_name", "box")
        self.scene.blocked_for_current_fingers = -1.0
        success, text = self.generate()
        self.scene.blocked_for_current_fingers = 1.0
        assert not success
        assert "with the fingers as they are now, the arm is in collision there ('palm' with 'wall')" in text
        assert self.generate()[0]

    def test_an_invalid_parameter_is_refused_until_it_is_corrected(self) -> None:
        """The node neither ends nor uses the default value."""
        self.set_parameter("object_name", "box")
        self.set_parameter("approach_distance", "far")
        success, text = self.generate()
        assert not success
        assert all(part in text for part in ("approach_distance", "'far'", "at least 0.01")), text
        self.set_parameter("approach_distance", APPROACH_M)
        assert self.generate()[0]

    def test_grasps_can_be_stored_under_names(self) -> None:
        """Fewer grasps leave no names of an earlier generation."""
        self.set_parameter("name_prefix", "box_")
        assert self.generate()[0]
        assert stored_grasps() == (["box_1", "box_2", "box_3"], 0)
        self.set_parameter("max_grasps", 2)
        assert self.generate()[0]
        assert stored_grasps() == (["box_1", "box_2"], 0)
        self.set_parameter("max_grasps", 3)
        assert self.generate()[0]
        assert next_grasp("box_1").grasp_message.grasp_id == "box_1"
        assert next_grasp("box_3").success

    def test_an_object_that_returns_under_its_name_gives_new_grasps(self) -> None:
        """The generator has seen the scene without the object before the object returns elsewhere."""
        self.set_parameter("name_prefix", "again_")
        self.scene.objects = [item for item in self.scene.objects if item.id != "box__link"]
        before = self.scene.scene_requests
        until(lambda: self.scene.scene_requests >= before + 4, "the generator sees the empty scene", 60.0)
        count = len(self.signals.signals)
        self.scene.add_box("box__link", BOX_SIZE, (0.1, 0.45, BOX_Z))
        success, reason = self.signals.wait(count + 1)
        assert success, reason
        assert_holds_box(next_grasp("again_1").grasp_message, 0.1, 0.45)
