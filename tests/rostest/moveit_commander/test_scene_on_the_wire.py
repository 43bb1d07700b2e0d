# SPDX-License-Identifier: BSD-3-Clause
"""The planning scene through moveit_commander: objects come and go, are attached, picked and placed."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import actionlib
import pytest
import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_commander import (
    MoveGroupCommander,
    MoveItCommanderException,
    PlanningSceneInterface,
    roscpp_initialize,
    roscpp_shutdown,
)
from moveit_commander.servers import SERVER_LOST_S
from moveit_msgs.msg import (
    AllowedCollisionMatrix,
    AttachedCollisionObject,
    ExecuteTrajectoryAction,
    ExecuteTrajectoryResult,
    Grasp,
    MoveGroupAction,
    MoveGroupResult,
    MoveItErrorCodes,
    PickupAction,
    PickupResult,
    PlaceAction,
    PlaceLocation,
    PlaceResult,
    PlanningScene,
    PlanningSceneComponents,
    RobotTrajectory,
)
from moveit_msgs.srv import GetCartesianPath, GetCartesianPathResponse
from std_msgs.msg import Header

from modular_framework_testing.ros_session import until

PALM = "ezgripper_palm_link"
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


@pytest.fixture(scope="module")
def scene(ros_session: Any) -> Iterator[PlanningSceneInterface]:
    ros_session.wait_for_service("apply_planning_scene", 120.0)
    roscpp_initialize([])
    yield PlanningSceneInterface()
    assert ros_session.answers("/move_group"), ros_session.log()
    roscpp_shutdown()


@pytest.fixture(scope="module")
def arm(scene: PlanningSceneInterface) -> MoveGroupCommander:
    return MoveGroupCommander("arm_and_manipulator", wait_for_servers=30.0)


@pytest.fixture(autouse=True)
def empty(scene: PlanningSceneInterface) -> None:
    scene.clear()
    assert scene.get_known_object_names() == [] and scene.get_attached_objects() == {}


def at(x: float, y: float, z: float, frame: str = "world") -> PoseStamped:
    return PoseStamped(Header(frame_id=frame), Pose(Point(x, y, z), Quaternion(0, 0, 0, 1)))


@pytest.fixture
def mesh_file(tmp_path: Path) -> str:
    path = tmp_path / "tetrahedron.obj"
    path.write_text(TETRAHEDRON)
    return str(path)


def test_every_kind_of_object_can_be_added(scene: PlanningSceneInterface, mesh_file: str) -> None:
    scene.add_box("box", at(0.5, 0.5, 1.0), (0.1, 0.2, 0.3))
    scene.add_sphere("sphere", at(0.5, -0.5, 1.0), 0.05)
    scene.add_cylinder("cylinder", at(-0.5, 0.5, 1.0), 0.2, 0.05)
    scene.add_mesh("mesh", at(-0.5, -0.5, 1.0), mesh_file, (0.1, 0.1, 0.2))
    scene.add_cone("cone", at(0.0, 0.9, 1.0), 0.2, 0.05)
    scene.add_plane("plane", at(0.0, 0.0, -1.0))
    scene.add_object(scene.make_sphere("second", at(1.0, 1.0, 1.0), 0.1))
    names = {"box", "sphere", "cylinder", "mesh", "cone", "plane", "second"}
    assert set(scene.get_known_object_names()) == names
    assert scene.get_known_object_names(with_type=True) == []
    objects = scene.get_objects()
    assert set(objects) == names and list(objects["box"].primitives[0].dimensions) == [0.1, 0.2, 0.3]
    assert len(objects["mesh"].meshes[0].triangles) == 4
    assert max(vertex.z for vertex in objects["mesh"].meshes[0].vertices) == pytest.approx(0.2)
    assert set(scene.get_objects(["box", "nobody"])) == {"box"}
    assert set(scene.get_known_object_names_in_roi(0.0, -1.0, 0.9, 0.6, 0.6, 1.1)) == {"box", "sphere"}
    pose = scene.get_object_poses(["box", "nobody"])
    assert set(pose) == {"box"} and pose["box"].position.x == pytest.approx(0.5)
    scene.remove_world_object("box")
    assert set(scene.get_known_object_names()) == names - {"box"}
    scene.remove_world_object()
    assert scene.get_known_object_names() == []


def test_objects_are_attached_and_detached(scene: PlanningSceneInterface, mesh_file: str) -> None:
    scene.add_box("block", at(0.3, 0.5, 0.9), (0.04, 0.04, 0.08))
    scene.attach_box(PALM, "block", touch_links=[PALM, "eg_manipulator"])
    assert scene.get_known_object_names() == []
    held = scene.get_attached_objects()["block"]
    assert held.link_name == PALM and set(held.touch_links) == {PALM, "eg_manipulator"}
    scene.attach_box(PALM, "box", at(0.0, 0.0, 0.1, PALM), (0.02, 0.02, 0.02))
    scene.attach_sphere(PALM, "sphere", at(0.0, 0.0, 0.1, PALM), 0.01)
    scene.attach_cylinder(PALM, "cylinder", at(0.0, 0.0, 0.1, PALM), 0.02, 0.01)
    scene.attach_mesh("tool0", "mesh", at(0.0, 0.0, 0.1, PALM), mesh_file, (0.01, 0.01, 0.01))
    scene.add_sphere("ball", at(0.5, 0.5, 1.5), 0.1)
    scene.attach_object("ball", PALM)
    thing = AttachedCollisionObject(
        link_name="tool0", object=scene.make_box("thing", at(0, 0, 0, PALM), (0.1, 0.1, 0.1))
    )
    scene.attach_object(thing)
    names = {"block", "box", "sphere", "cylinder", "mesh", "ball", "thing"}
    assert set(scene.get_attached_objects()) == names
    assert set(scene.get_attached_objects(["ball"])) == {"ball"}
    scene.remove_attached_object(PALM, "ball")
    assert scene.get_known_object_names() == ["ball"], "a detached object stays in the scene"
    scene.remove_attached_object("tool0")
    assert set(scene.get_attached_objects()) == names - {"ball", "mesh", "thing"}
    scene.remove_attached_object()
    assert set(scene.get_known_object_names()) == names
    for kind in ("sphere", "cylinder", "mesh"):
        getattr(scene, f"attach_{kind}")(PALM, kind)
        assert kind in scene.get_attached_objects()


def test_a_refused_change_is_an_error(scene: PlanningSceneInterface, tmp_path: Path) -> None:
    with pytest.raises(MoveItCommanderException, match="'block' was refused"):
        scene.add_box("block", at(0.0, 0.0, 1.0, "nowhere"), (1, 1, 1))
    with pytest.raises(MoveItCommanderException, match="every size must be above 0"):
        scene.add_box("block", at(0.0, 0.0, 1.0), (1, 0, 1))
    with pytest.raises(MoveItCommanderException, match="cannot be read"):
        scene.add_mesh("mesh", at(0.0, 0.0, 1.0), str(tmp_path / "absent.stl"))
    (tmp_path / "broken.stl").write_text("no mesh")
    with pytest.raises(MoveItCommanderException, match="broken.stl"):
        scene.add_mesh("mesh", at(0.0, 0.0, 1.0), str(tmp_path / "broken.stl"))


def test_scenes_are_read_and_applied_whole(scene: PlanningSceneInterface) -> None:
    matrix: AllowedCollisionMatrix = scene.get_planning_scene(
        PlanningSceneComponents.ALLOWED_COLLISION_MATRIX
    ).allowed_collision_matrix
    matrix.set_allowed("block")
    matrix.set_allowed("block", "forearm_link", True)
    change = PlanningScene(is_diff=True, allowed_collision_matrix=matrix)
    change.world.collision_objects = [scene.make_box("block", at(0.3, 0.5, 0.9), (0.1, 0.1, 0.1))]
    assert scene.apply_planning_scene(change) is True
    again = scene.get_planning_scene(PlanningSceneComponents.ALLOWED_COLLISION_MATRIX).allowed_collision_matrix
    assert dict(zip(again.default_entry_names, again.default_entry_values, strict=True))["block"]
    row = again.entry_values[again.entry_names.index("block")]
    assert row.enabled[again.entry_names.index("forearm_link")]
    assert scene.get_known_object_names() == ["block"]
    change.world.collision_objects = [scene.make_box("", at(0.3, 0.5, 0.9), (0.1, 0.1, 0.1))]
    assert scene.apply_planning_scene(change) is False


def test_an_asynchronous_scene_publishes(scene: PlanningSceneInterface) -> None:
    quick = PlanningSceneInterface(synchronous=False)
    quick.add_box("block", at(0.3, 0.5, 0.9), (0.1, 0.1, 0.1))
    until(lambda: scene.get_known_object_names() == ["block"], "the block in the scene")
    quick.attach_object("block", PALM)
    until(lambda: set(scene.get_attached_objects()) == {"block"}, "the block attached")


def test_a_group_attaches_and_detaches(scene: PlanningSceneInterface, arm: MoveGroupCommander) -> None:
    def attached() -> dict[str, str]:
        return {name: item.link_name for name, item in scene.get_attached_objects().items()}

    for name in ("first", "second"):
        scene.add_box(name, at(0.3, 0.5, 0.9), (0.1, 0.1, 0.1))
    assert arm.attach_object("first") is True
    until(lambda: attached() == {"first": "eg_manipulator"}, "the first attached")
    assert arm.attach_object("second", PALM, [PALM, "tool0"])
    until(lambda: attached() == {"first": "eg_manipulator", "second": PALM}, "both attached")
    assert set(scene.get_attached_objects()["second"].touch_links) == {PALM, "tool0"}
    assert arm.detach_object("second") is True
    until(lambda: attached() == {"first": "eg_manipulator"}, "only the first attached")
    assert arm.detach_object("eg_manipulator")
    until(lambda: attached() == {}, "all detached that the hand holds")
    assert arm.attach_object("first") and arm.detach_object()
    until(lambda: attached() == {}, "everything detached")
    assert set(scene.get_known_object_names()) == {"first", "second"}


class FakeTask:
    """An action server that keeps its goals and answers success."""

    def __init__(self, name: str, kind: Any, result: Any) -> None:
        self.goals: list[Any] = []
        self._result = result
        self._server = actionlib.SimpleActionServer(name, kind, self._serve, auto_start=False)
        self._server.start()

    def _serve(self, goal: Any) -> None:
        self.goals.append(goal)
        self._server.set_succeeded(self._result)


@pytest.fixture
def elsewhere(arm: MoveGroupCommander) -> Callable[[str], MoveGroupCommander]:
    """Makes commanders of the same group that ask servers in another namespace."""

    def make(namespace: str) -> MoveGroupCommander:
        for name, kind, result in (
            ("move_group", MoveGroupAction, MoveGroupResult()),
            ("execute_trajectory", ExecuteTrajectoryAction, ExecuteTrajectoryResult()),
        ):
            FakeTask(f"{namespace}/{name}", kind, result)
        return MoveGroupCommander(arm.get_name(), ns=namespace)

    return make


def test_a_location_of_another_type_is_refused(arm: MoveGroupCommander) -> None:
    for location in (3.0, [3.0]):
        with pytest.raises(MoveItCommanderException, match="Parameter location must be"):
            arm.place("block", location)


def test_pick_and_place_name_what_is_missing_and_use_what_is_there(
    arm: MoveGroupCommander, elsewhere: Callable[[str], MoveGroupCommander]
) -> None:
    pose = at(0.3, 0.5, 0.9)
    locations = [None, pose, pose.pose, PlaceLocation(place_pose=pose), [pose, pose], [PlaceLocation(place_pose=pose)]]
    assert arm.pick("block", Grasp(), plan_only=True) == MoveItErrorCodes.ROBOT_STATE_STALE, "this robot has no joints"
    arm = elsewhere("fake")
    with ThreadPoolExecutor() as pool:  # both wait until nobody has answered for long
        for act in [pool.submit(arm.pick, "block", Grasp()), pool.submit(arm.place, "block", pose)]:
            with pytest.raises(MoveItCommanderException, match="Unable to connect"):
                act.result()
    success = MoveItErrorCodes(MoveItErrorCodes.SUCCESS)
    pickup = FakeTask("fake/pickup", PickupAction, PickupResult(error_code=success))
    arm.set_support_surface_name("table")
    for grasp in (Grasp(id="one"), [Grasp(id="one"), Grasp(id="two")]):
        assert arm.pick("block", grasp, plan_only=True) == MoveItErrorCodes.SUCCESS
    assert [[grasp.id for grasp in goal.possible_grasps] for goal in pickup.goals] == [["one"], ["one", "two"]]
    goal = pickup.goals[0]
    assert (goal.target_name, goal.group_name, goal.end_effector) == (
        "block",
        "arm_and_manipulator",
        "ezgripper_finger_1_ee",
    )
    assert goal.planning_options.plan_only and goal.allow_gripper_support_collision
    place = FakeTask("fake/place", PlaceAction, PlaceResult(error_code=success))
    assert [arm.place("block", item) for item in locations] == [True] * len(locations)
    assert [len(goal.place_locations) for goal in place.goals] == [0, 1, 1, 1, 2, 1]
    assert place.goals[2].place_locations[0].place_pose.header.frame_id == "world"
    assert arm.pick("block") == MoveItErrorCodes.SUCCESS and pickup.goals[-1].possible_grasps == [], "up to move_group"


def test_no_answer_of_a_server_that_is_done_at_once_is_lost(
    arm: MoveGroupCommander, elsewhere: Callable[[str], MoveGroupCommander]
) -> None:
    place = FakeTask("instant/place", PlaceAction, PlaceResult(error_code=MoveItErrorCodes(MoveItErrorCodes.SUCCESS)))
    arm = elsewhere("instant")
    longest_s = 0.0
    for _ in range(60):
        begun = time.monotonic()
        assert arm.place("block", at(0.3, 0.5, 0.9))
        longest_s = max(longest_s, time.monotonic() - begun)
    assert len(place.goals) == 60
    assert longest_s < SERVER_LOST_S, "no result was waited for in vain"


def test_a_cartesian_path_asks_for_the_lines_and_answers_path_and_share(
    arm: MoveGroupCommander, elsewhere: Callable[[str], MoveGroupCommander]
) -> None:
    asked: list[Any] = []
    codes = [MoveItErrorCodes.SUCCESS, MoveItErrorCodes.INVALID_GROUP_NAME]

    def serve(request: Any) -> GetCartesianPathResponse:
        asked.append(request)
        path = RobotTrajectory()
        path.joint_trajectory.joint_names = ["elbow_joint"]
        return GetCartesianPathResponse(
            solution=path, fraction=0.75, error_code=MoveItErrorCodes(codes[len(asked) - 1])
        )

    rospy.Service("fake/compute_cartesian_path", GetCartesianPath, serve)
    arm = elsewhere("fake")
    path, fraction = arm.compute_cartesian_path([Pose(), [0.1, 0.2, 0.3, 0.0, 0.0, 0.0]], 0.01, 2.5, False)
    assert fraction == 0.75 and path.joint_trajectory.joint_names == ["elbow_joint"]
    assert arm.compute_cartesian_path([Pose()], 0.02) == (RobotTrajectory(), -1.0)
    first, second = asked
    assert (first.max_step, first.jump_threshold, first.avoid_collisions) == (0.01, 2.5, False)
    assert (second.max_step, second.jump_threshold, second.avoid_collisions) == (0.02, 0.0, True)
    assert (first.group_name, first.link_name, first.header.frame_id) == (
        "arm_and_manipulator",
        "eg_manipulator",
        "world",
    )
    assert first.waypoints[1].position.z == 0.3 and first.start_state.is_diff


def test_a_script_needs_no_node_of_its_own_and_ends(scene: PlanningSceneInterface) -> None:
    script = (
        "import sys, moveit_commander as m; m.roscpp_initialize(sys.argv); r = m.RobotCommander(); "
        "print(r.get_group_names()); m.roscpp_shutdown(); m.roscpp_shutdown()"
    )
    ended = subprocess.run(
        [sys.executable, "-c", script, "__name:=other"], capture_output=True, text=True, timeout=30.0, check=False
    )
    assert ended.returncode == 0 and "'arm_and_manipulator'" in ended.stdout, ended.stderr
