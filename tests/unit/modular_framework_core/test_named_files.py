# SPDX-License-Identifier: BSD-3-Clause
"""Files of named joint states, trajectories and sensors: good entries are kept, bad ones are named with their line."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from modular_framework_core.managers.joint_bounds import bounds_from_urdf
from modular_framework_core.managers.named_joint_states import load_joint_states
from modular_framework_core.managers.named_poses import NamedPose, Placement
from modular_framework_core.managers.named_trajectories import load_trajectories
from modular_framework_core.scene.sensor_frames import load_sensor_frames
from modular_framework_urdf.rotations import quaternion_from_rpy

EXAMPLE_TRAJECTORY = """
example_trajectory:
  - {name: stability_gravity_down, interpolate_time: 0.4, pause_time: 0.25}
  - {name: stability_gravity_side, interpolate_time: 0.4, pause_time: 0.25}
  - {name: stability_gravity_down, interpolate_time: 0.4, pause_time: 0.25}
  - {name: stability_gravity_side, interpolate_time: 0.4, pause_time: 0.25}
  - {name: stability_pose, interpolate_time: 0.4, pause_time: 0.25}
"""
STATES = {
    "stability_gravity_down": {"wrist": -0.3735, "elbow": 0.35},
    "stability_pose": {"elbow": 1.57, "wrist": -1.57},
    "stability_gravity_side": {"elbow": 0.35, "wrist": -1.97},
    "short": {"elbow": 0.0},
}


def write(folder: Path, text: str) -> Path:
    path = folder / "file.yaml"
    path.write_text(text)
    return path


def test_positions_keep_double_precision_and_file_order(tmp_path: Path) -> None:
    states, faults = load_joint_states(write(tmp_path, "pose: {b: 1.5707963268, a: -2, c: 1e-3}\n"))
    assert not faults
    assert states[0].joint_names == ("b", "a", "c")
    assert states[0].positions == (1.5707963268, -2.0, 0.001)


@pytest.mark.parametrize(
    ("text", "line", "hint"),
    [
        ("good: {a: 1}\nbad: {a: x}\n", 2, "finite number"),
        ("good: {a: 1}\nbad: 5\n", 2, "mapping"),
        ("good: {a: 1}\nbad: {}\n", 2, "no joint"),
        ("good: {a: 1}\nbad:\n  a: 1\n  b: .nan\n", 4, "finite number"),
        ("good: {a: 1}\nbad: {a: 1, a: 2}\n", 2, "twice"),
        ("good: {a: 1}\ngood: {a: 2}\n", 2, "occurs earlier"),
        ("good: {a: 1}\nbad: {a: '1'}\n", 2, "finite number"),
        ('good: {a: 1}\n"": {a: 1}\n', 2, "the name is empty"),
    ],
)
def test_a_bad_joint_state_is_named_and_the_others_stay(tmp_path: Path, text: str, line: int, hint: str) -> None:
    states, faults = load_joint_states(write(tmp_path, text))
    assert [state.name for state in states] == ["good"]
    assert len(faults) == 1
    assert f"file.yaml:{line}:" in str(faults[0])
    assert hint in str(faults[0])


BOUNDS = bounds_from_urdf("""<robot name="r"><joint name="elbow" type="revolute"><limit lower="-1" upper="2"/></joint>
<joint name="wheel" type="continuous"/><joint name="mount" type="fixed"/></robot>""")


def test_joints_of_the_robot_that_move_and_their_bounds_are_read_from_its_description() -> None:
    assert {"elbow": (-1.0, 2.0), "wheel": (-math.inf, math.inf)} == BOUNDS


@pytest.mark.parametrize(
    ("entry", "hint"),
    [
        ("{elbow: 2.1}", "got 2.1, the joint moves from -1.0000 to 2.0000"),
        ("{elbw: 0}", "no movable joint 'elbw'; it has elbow, wheel; did you mean 'elbow'?"),
        ("{mount: 0}", "'mount'"),
    ],
)
def test_a_joint_state_the_robot_cannot_have_is_named(tmp_path: Path, entry: str, hint: str) -> None:
    text = f"bad: {entry}\ngood: {{elbow: 2.0, wheel: 100}}\n"
    states, faults = load_joint_states(write(tmp_path, text), BOUNDS)
    assert [state.name for state in states] == ["good"]
    assert "file.yaml:1:" in str(faults[0]) and hint in str(faults[0])


def test_a_sensor_may_stand_at_a_pose_that_has_a_name(tmp_path: Path) -> None:
    stored = NamedPose("corner", "world", {"": Placement((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))})
    text = "cam: {frame_id: cam, initial_pose: corner}\nlost: {frame_id: x, initial_pose: cornr}\n"
    frames, faults = load_sensor_frames(write(tmp_path, text), {"corner": stored}.get)
    found = [(frame.frame, frame.parent_frame, frame.placement.position_m) for frame in frames]
    assert found == [("cam", "world", (1.0, 2.0, 3.0))]
    assert "file.yaml:2:" in str(faults[0]) and "no pose named 'cornr' is stored" in str(faults[0])


@pytest.mark.parametrize("text", ["a: [1\n", "- a\n", "a: !!python/object/apply:os.system ['true']\n"])
def test_a_file_that_is_no_mapping_of_entries_gives_faults_instead_of_an_exception(tmp_path: Path, text: str) -> None:
    states, faults = load_joint_states(write(tmp_path, text))
    assert not states
    assert faults


def test_a_missing_file_is_named_and_an_empty_one_is_fine(tmp_path: Path) -> None:
    assert "nowhere.yaml" in str(load_joint_states(tmp_path / "nowhere.yaml")[1][0])
    assert load_joint_states(write(tmp_path, "")) == ([], [])


def test_the_shipped_example_trajectory_has_ten_points_at_the_documented_times(tmp_path: Path) -> None:
    trajectories, faults = load_trajectories(write(tmp_path, EXAMPLE_TRAJECTORY), STATES.get)
    assert not faults
    trajectory = trajectories[0]
    assert trajectory.joint_names == ("elbow", "wrist")
    assert [time for _, time in trajectory.points] == pytest.approx(
        [0.4, 0.65, 1.05, 1.30, 1.70, 1.95, 2.35, 2.60, 3.00, 3.25]
    )
    assert trajectory.points[0][0] == trajectory.points[1][0] == (0.35, -0.3735)
    assert trajectory.points[-1][0] == (1.57, -1.57)


@pytest.mark.parametrize(
    ("items", "hint"),
    [
        ("[{name: unknown, interpolate_time: 1}]", "no joint state named 'unknown'"),
        ("[{name: stability_pose, interpolate_time: 1}, {name: short, interpolate_time: 1}]", "must be the same"),
        ("[{name: stability_pose}]", "interpolate_time"),
        ("[{name: stability_pose, interpolate_time: 0}]", "more than 0"),
        ("[{name: stability_pose, interpolate_time: 1, pause_time: -1}]", "0 or more"),
        ("[]", "no waypoint"),
        ("{a: 1}", "expected a list"),
        ("[{name: stability_pose, interpolate_time: 1, pause: 1}]", "unknown keys"),
    ],
)
def test_a_bad_trajectory_is_dropped_whole_and_the_next_one_is_loaded(tmp_path: Path, items: str, hint: str) -> None:
    text = f"bad: {items}\ngood: [{{name: stability_pose, interpolate_time: 0.5}}]\n"
    trajectories, faults = load_trajectories(write(tmp_path, text), STATES.get)
    assert [trajectory.name for trajectory in trajectories] == ["good"]
    assert hint in str(faults[0])
    assert "file.yaml:1" in str(faults[0])


SENSOR = (
    "frame_id: cam, origin_frame_id: world, frame_x: -0.1645, frame_y: 0.375, frame_z: 2.72, "
    "frame_roll: 3.14159265359, frame_pitch: 0, frame_yaw: -1.57079632679"
)


def test_sensor_frames_are_read_and_single_values_are_left_alone(tmp_path: Path) -> None:
    frames, faults = load_sensor_frames(write(tmp_path, f"kinect: {{{SENSOR}}}\npointcloud_topic_name: a/b\n"))
    assert not faults
    assert (frames[0].parent_frame, frames[0].frame, frames[0].placement.position_m) == (
        "world",
        "cam",
        (-0.1645, 0.375, 2.72),
    )
    assert frames[0].placement.quaternion_xyzw == pytest.approx((math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0), abs=1e-9)


def test_the_later_layout_with_an_inline_pose_gives_the_same_frame(tmp_path: Path) -> None:
    text = (
        "cam: {frame_id: cam, initial_pose: {reference_frame: world, position: {x: 1, y: 2, z: 3}, "
        "orientation: {r: 0.1, p: 0.2, y: 0.3}}}\n"
    )
    frames, faults = load_sensor_frames(write(tmp_path, text))
    assert not faults
    assert frames[0].placement.position_m == (1.0, 2.0, 3.0)
    assert frames[0].placement.quaternion_xyzw == pytest.approx(quaternion_from_rpy(0.1, 0.2, 0.3))


@pytest.mark.parametrize(
    ("bad", "hint"),
    [
        ("{frame_id: cam}", "origin_frame_id"),
        (f"{{{SENSOR.replace('2.72', 'high')}}}", "finite number"),
        (f"{{{SENSOR.replace('frame_id: cam', 'frame_id: world', 1)}}}", "its own origin"),
        ("{frame_id: cam, initial_pose: {position: {x: 1}}}", "reference_frame"),
    ],
)
def test_a_wrong_sensor_is_named_and_the_others_stay(tmp_path: Path, bad: str, hint: str) -> None:
    frames, faults = load_sensor_frames(write(tmp_path, f"bad: {bad}\ngood: {{{SENSOR}}}\n"))
    assert [frame.sensor for frame in frames] == ["good"]
    assert hint in str(faults[0])
