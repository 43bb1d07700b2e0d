# SPDX-License-Identifier: BSD-3-Clause
"""compute_cartesian_path on the wire: straight, timed, with the fraction that was found and why it ends early."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import Constraints, JointConstraint, MoveItErrorCodes, RobotState
from moveit_msgs.srv import GetCartesianPath, GetCartesianPathRequest
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from modular_framework_testing.planning.planning_wire import (
    ARM,
    DOWN,
    GROUP,
    OK,
    START,
    TIP,
    add,
    box,
    call,
    hold,
    report_of,
    tip_pose,
    vector,
)

MAX_VELOCITY, MAX_ACCELERATION = 3.2, 8.0
pytestmark = [pytest.mark.move_group(service="compute_cartesian_path"), pytest.mark.usefixtures("clean_scene")]


def shifted(pose: Pose, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Pose:
    return Pose(Point(pose.position.x + x, pose.position.y + y, pose.position.z + z), pose.orientation)


def follow(*waypoints: Pose, **changes: Any) -> Any:
    message = GetCartesianPathRequest(
        group_name=GROUP,
        waypoints=list(waypoints),
        max_step=0.01,
        avoid_collisions=True,
        start_state=RobotState(is_diff=True),
    )
    message.header.frame_id = "world"
    for name, value in changes.items():
        setattr(message, name, value)
    return call("compute_cartesian_path", GetCartesianPath, message)


def rows_of(answer: Any) -> tuple[np.ndarray, np.ndarray]:
    points = answer.solution.joint_trajectory.points
    return (
        np.array([point.positions for point in points]),
        np.array([point.time_from_start.to_sec() for point in points]),
    )


def test_a_line_is_straight_and_timed_within_limits(home: Pose) -> None:
    answer = follow(shifted(home, 0.15, 0.0, -0.1))
    assert answer.error_code.val == OK and answer.fraction == 1.0
    assert list(answer.solution.joint_trajectory.joint_names) == ARM
    rows, times = rows_of(answer)
    assert np.allclose(rows[0], START, atol=1e-6)
    assert times[0] == 0.0 and (np.diff(times) > 0.0).all()
    direction = np.array([0.15, 0.0, -0.1]) / np.linalg.norm([0.15, 0.0, -0.1])
    for values in rows[::4]:
        way = vector(tip_pose(values)) - vector(home)
        assert np.linalg.norm(way - (way @ direction) * direction) < 2e-4
    assert np.allclose(vector(tip_pose(rows[-1])), vector(shifted(home, 0.15, 0.0, -0.1)), atol=1e-5)
    points = answer.solution.joint_trajectory.points
    assert np.abs([point.velocities for point in points]).max() <= MAX_VELOCITY
    assert np.abs([point.accelerations for point in points]).max() <= MAX_ACCELERATION
    assert not any(points[-1].velocities) and list(answer.start_state.joint_state.name)


def test_waypoints_may_be_in_any_frame(home: Pose) -> None:
    add(box("crate", 0.5, 1.0, 1.5, (0.1, 0.1, 0.1)))
    target = shifted(home, 0.1, 0.0, -0.05)
    in_crate = Pose(Point(target.position.x - 0.5, target.position.y - 1.0, target.position.z - 1.5), home.orientation)
    answer = follow(in_crate, header=Header(frame_id="crate"))
    assert answer.fraction == 1.0
    assert np.allclose(vector(tip_pose(rows_of(answer)[0][-1])), vector(target), atol=1e-5)
    down = Pose(Point(0.0, 0.0, 0.05), Quaternion(0, 0, 0, 1))  # the tip looks down: twice 5 cm ahead
    answer = follow(down, down, header=Header(frame_id=TIP))
    assert answer.fraction == 1.0
    assert np.allclose(vector(tip_pose(rows_of(answer)[0][-1])), vector(shifted(home, z=-0.1)), atol=1e-3)


def test_several_waypoints_are_all_passed(home: Pose) -> None:
    corners = [shifted(home, 0.1), shifted(home, 0.1, 0.0, -0.1), shifted(home, 0.0, 0.0, -0.1), home]
    answer = follow(*corners)
    assert answer.fraction == 1.0
    ways = np.array([vector(tip_pose(values)) for values in rows_of(answer)[0]])
    for corner in corners:
        assert np.linalg.norm(ways - vector(corner), axis=1).min() < 1e-4


def test_a_wall_ends_the_line_and_is_named_unless_collisions_may_be(home: Pose) -> None:
    wall = box("wall", home.position.x + 0.3, home.position.y, home.position.z, (0.02, 0.5, 0.5))
    assert add(wall)
    answer, report = report_of(lambda: follow(shifted(home, 0.05), shifted(home, 0.4)))
    assert answer.error_code.val == OK and 0.5 < answer.fraction < 1.0
    assert re.match(r"waypoint 1, step \d+ of \d+: .*'wall'.* mm deep", report["reason"]), report
    assert report["fraction"] == answer.fraction
    reached = vector(tip_pose(rows_of(answer)[0][-1]))[0] - home.position.x
    followed = 0.05 + (2.0 * answer.fraction - 1.0) * 0.35
    assert reached == pytest.approx(followed, abs=1e-4), "the fraction is how far the path really goes"
    assert follow(shifted(home, 0.05), shifted(home, 0.4), avoid_collisions=False).fraction == 1.0


def test_a_line_out_of_reach_says_so(home: Pose) -> None:
    answer, report = report_of(lambda: follow(shifted(home, 0.0, 1.5)))
    assert answer.error_code.val == OK and 0.0 < answer.fraction < 1.0
    assert re.match(r"waypoint 0, step \d+ of 150: .*(reach|jump|outside|orientation)", report["reason"]), report


@pytest.mark.parametrize("changes", [{"jump_threshold": 1.01}, {"revolute_jump_threshold": 0.002}])
def test_jump_thresholds_end_a_line_and_name_the_joint(home: Pose, changes: dict[str, float]) -> None:
    answer, report = report_of(lambda: follow(shifted(home, 0.2, 0.0, -0.1), **changes))
    assert answer.error_code.val == OK and answer.fraction < 1.0
    assert re.search(r"joint '\w+_joint'.*jump_threshold", report["reason"]), report


def turn_of(pose: Pose) -> Rotation:
    return Rotation.from_quat([pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w])


def rod_at(tip: Pose) -> np.ndarray:
    """Where the middle of the held rod is."""
    return vector(tip) + turn_of(tip).apply([0.0, 0.0, 0.2])


def test_a_held_object_follows_the_line_itself(home: Pose) -> None:
    hold(box("rod", 0.0, 0.0, 0.2, (0.02, 0.02, 0.1)))
    begin, shift = rod_at(home), np.array([0.05, 0.0, 0.05])
    turn = Rotation.from_euler("y", 0.5) * turn_of(home)
    goal = Pose(Point(*(begin + shift)), Quaternion(*turn.as_quat()))
    answer = follow(goal, link_name="rod")
    assert answer.error_code.val == OK and answer.fraction == 1.0
    along = np.array([rod_at(tip_pose(row)) - begin for row in rows_of(answer)[0][::5]])
    way = shift / np.linalg.norm(shift)
    assert np.linalg.norm(along - np.outer(along @ way, way), axis=1).max() < 1e-3
    end = tip_pose(rows_of(answer)[0][-1])
    assert np.allclose(rod_at(end), begin + shift, atol=1e-5) and (turn_of(end).inv() * turn).magnitude() < 1e-5


def test_path_constraints_end_a_line(home: Pose) -> None:
    tight = Constraints(
        joint_constraints=[
            JointConstraint(
                joint_name="shoulder_pan_joint",
                position=START[0],
                tolerance_above=0.05,
                tolerance_below=0.05,
                weight=1.0,
            )
        ]
    )
    answer, report = report_of(lambda: follow(shifted(home, 0.2), path_constraints=tight))
    assert answer.error_code.val == OK and 0.0 < answer.fraction < 1.0
    assert "path_constraints: joint 'shoulder_pan_joint'" in report["reason"]
    assert abs(rows_of(answer)[0][-1][0] - START[0]) <= 0.05 + 1e-6


def test_the_link_keeps_its_speed_limit(home: Pose) -> None:
    free = follow(shifted(home, 0.2))
    slow = follow(shifted(home, 0.2), max_cartesian_speed=0.1, cartesian_speed_limited_link=TIP)
    assert slow.fraction == 1.0 and rows_of(slow)[1][-1] > max(2.0, 2.0 * rows_of(free)[1][-1])
    rows, times = rows_of(slow)
    ways = np.array([vector(tip_pose(values)) for values in rows])
    assert (np.linalg.norm(np.diff(ways, axis=0), axis=1) / np.diff(times)).max() <= 0.1 * 1.01


NAN = float("nan")
CODES = MoveItErrorCodes


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"group_name": "nobody"}, CODES.INVALID_GROUP_NAME),
        ({"link_name": "nobody"}, CODES.INVALID_LINK_NAME),
        ({"header": Header(frame_id="nowhere")}, CODES.FRAME_TRANSFORM_FAILURE),
        ({"waypoints": []}, CODES.INVALID_MOTION_PLAN),
        ({"max_step": 0.0}, CODES.FAILURE),
        ({"max_step": NAN}, CODES.FAILURE),
        ({"jump_threshold": -1.0}, CODES.INVALID_MOTION_PLAN),
        ({"revolute_jump_threshold": NAN}, CODES.INVALID_MOTION_PLAN),
        ({"waypoints": [Pose()]}, CODES.FAILURE),
        ({"waypoints": [Pose(Point(NAN, 0, 0), DOWN)]}, CODES.FAILURE),
        ({"max_cartesian_speed": NAN}, CODES.INVALID_MOTION_PLAN),
        ({"link_name": "base_link"}, CODES.NO_IK_SOLUTION),
        ({"max_cartesian_speed": 0.1, "cartesian_speed_limited_link": "nobody"}, CODES.INVALID_LINK_NAME),
        ({"start_state": RobotState(joint_state=JointState(name=ARM, position=[NAN] * 6))}, CODES.INVALID_ROBOT_STATE),
    ],
)
def test_malformed_requests_get_a_code(home: Pose, changes: dict[str, Any], code: int) -> None:
    answer = follow(*changes.pop("waypoints", [shifted(home, 0.02)]), **changes)
    assert answer.error_code.val == code and answer.fraction == 0.0
