# SPDX-License-Identifier: BSD-3-Clause
"""Files on a full disk, of strange kinds and names, nested without end: a reason at once, and nothing left behind."""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import trimesh
from geometry_msgs.msg import Transform
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectoryPoint, MultiDOFJointTrajectoryPoint

from modular_framework_core.files import shallow_yaml, yaml_entries
from modular_framework_core.files.atomic_files import read_text, write_atomically
from modular_framework_core.managers import message_files
from modular_framework_core.managers.message_files import MessageFileError
from modular_framework_core.managers.message_numbers import position_fault
from modular_framework_core.managers.named_joint_states import load_joint_states
from modular_framework_core.srv import AddMoveitPlanRequest, AddStandardisedGraspRequest
from modular_framework_core.task_constructor import generator
from modular_framework_core.task_runner.record import StateRecord
from modular_framework_core.task_runner.task_runner import TaskResult, write_record
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.sdf_specs import Mesh


@contextmanager
def full_disk() -> Iterator[None]:
    """A disk that takes 100 bytes of a file, for the code inside only: pytest itself may write to a file."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def left_in(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o002, 0o664), (0o077, 0o600)])
def test_permissions_follow_the_umask(tmp_path: Path, mask: int, mode: int) -> None:
    before = os.umask(mask)
    try:
        write_atomically(tmp_path / "shared.yaml", "new")
        write_atomically(tmp_path / "own.yaml", "new", mode=0o600)
    finally:
        os.umask(before)
    assert (tmp_path / "shared.yaml").stat().st_mode & 0o777 == mode
    assert (tmp_path / "own.yaml").stat().st_mode & 0o777 == 0o600


def test_a_failed_save_leaves_the_old_file_alone_and_names_its_path(tmp_path: Path) -> None:
    path = tmp_path / "kept.yaml"
    path.write_text("old")
    with pytest.raises(MessageFileError, match="kept.yaml cannot be written: .*free space.*kept.yaml"), full_disk():
        message_files.save(path, "joint state", {"a": JointState(name=["a" * 200])}, [])
    assert (path.read_text(), left_in(tmp_path)) == ("old", ["kept.yaml"])


def test_a_state_machine_that_cannot_be_written_leaves_nothing_and_is_named(tmp_path: Path) -> None:
    class Task:
        name = "pick"

    with pytest.raises(OSError, match=r"free space, or name another folder: '.*/pick.py'"), full_disk():
        generator.write(Task(), "x" * 200, tmp_path)
    assert left_in(tmp_path) == []


def test_a_record_that_cannot_be_written_leaves_nothing_and_is_named(tmp_path: Path) -> None:
    record = StateRecord("A" * 200, 0.0)
    with pytest.raises(OSError, match=r"free space, or name another folder: '.*/pick_.*json'"), full_disk():
        write_record(tmp_path, 0.0, TaskResult("pick", "done", 0), (record,), ())
    assert left_in(tmp_path) == []


def test_a_cache_of_meshes_that_cannot_be_written_leaves_nothing_and_is_named(tmp_path: Path) -> None:
    mesh, cache = tmp_path / "block.obj", tmp_path / "cache"
    trimesh.creation.box((0.123456789, 0.123456789, 0.123456789)).export(mesh)
    parts = ConvexParts(cache)
    refused = pytest.raises(DescriptionError, match="block-hull.*cannot be written.*free disk space, or set ROS_HOME")
    with refused, full_disk():
        parts.hull(Mesh(mesh))
    assert list(cache.iterdir()) == []


def test_what_is_there_and_no_file_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    with pytest.raises(OSError, match="not a regular file.*pipe.yaml"):
        write_atomically(tmp_path / "pipe.yaml", "text")
    assert left_in(tmp_path) == [] and (tmp_path / "pipe.yaml").is_fifo()


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("a\0.yaml", "is not a valid path: embedded null byte; name a file in"),
        ("~no_such_user/a.yaml", "is not a valid path: Could not determine home directory.; name a file in"),
        ("../a.yaml", "is outside of the managers' folder"),
        ("/etc/a.yaml", "is outside of the managers' folder"),
        ("link/a.yaml", "is outside of the managers' folder"),
        ("ring/a.yaml", "is not a valid path"),
        ("x.txt", "a file that ends in .yaml"),
        ("", "a file that ends in .yaml"),
        ("a.yaml/..", "a file that ends in"),
        ("\udcff.txt", "a file that ends in .yaml"),
    ],
)
def test_a_path_that_is_none_or_elsewhere_is_refused(tmp_path: Path, path: str, reason: str) -> None:
    folder = tmp_path / "managers"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path)
    (folder / "ring").symlink_to(folder / "ring")
    with pytest.raises(MessageFileError) as refused:
        message_files.path_of(path, folder)
    assert reason in str(refused.value)


def test_a_path_in_the_managers_folder_or_beside_the_configuration_is_taken(tmp_path: Path) -> None:
    assert message_files.path_of("sub/a.yaml", tmp_path) == tmp_path / "sub" / "a.yaml"
    assert message_files.path_of(str(tmp_path / "a.yml"), tmp_path) == tmp_path / "a.yml"
    other = tmp_path / "config"
    assert message_files.path_of(str(other / "a.yaml"), tmp_path / "managers", [other]) == other / "a.yaml"


DEEP = {
    "json": "[" * 20000 + "]" * 20000,
    "flow": "a: " + "[" * 20000 + "]" * 20000,
    "open": "{a: " * 20000,
    "block": "\n".join(f"{' ' * number}a:" for number in range(300)),
    "dashes": "- " * 20000,
}


@pytest.mark.parametrize("text", DEEP.values(), ids=DEEP)
def test_what_is_nested_without_end_is_refused_with_its_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "deep.yaml"
    path.write_text(text)
    with pytest.raises(MessageFileError, match=r"deep.yaml cannot be read: line \d+ is nested more than 100 levels"):
        message_files.load(path, "joint state", JointState)
    assert "nested more than 100 levels deep" in str(load_joint_states(path)[1][0])
    with pytest.raises(shallow_yaml.TooDeepError):
        shallow_yaml.load(text)


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    with pytest.raises(MessageFileError, match="pipe.yaml is not a regular file; name a text file"):
        message_files.load(tmp_path / "pipe.yaml", "joint state", JointState)
    _, faults = yaml_entries.read_each_entry(tmp_path / "pipe.yaml", lambda entry: None)
    assert "is not a regular file" in str(faults[0])
    with pytest.raises(OSError, match="is not a valid path"):
        read_text(Path("a\0b"))


def test_positions_that_are_not_finite_are_found_and_other_numbers_left_alone() -> None:
    state = JointState(name=["a", "b"], position=[0.0, float("nan")], velocity=[float("nan"), 0.0])
    assert position_fault(state) == "position[1] is nan"
    state.position = [1e308, 1e308]
    assert position_fault(state) == ""
    state.velocity = [0.0]
    assert position_fault(state) == "velocity has 1 values for 2 names"
    plan = AddMoveitPlanRequest().moveit_plan
    plan.joint_trajectory.joint_names = ["a"]
    plan.joint_trajectory.points = [
        JointTrajectoryPoint(positions=[0.0], accelerations=[float("nan")]),
        JointTrajectoryPoint(positions=[float("-inf")]),
    ]
    assert position_fault(plan) == "joint_trajectory.points[1].positions[0] is -inf"
    grasp = AddStandardisedGraspRequest().grasp_message
    grasp.grasp.pose.pose.orientation.w = float("inf")
    assert position_fault(grasp) == "grasp.pose.pose.orientation.w is inf"


def test_points_of_a_trajectory_have_a_value_for_each_joint_or_none() -> None:
    plan = AddMoveitPlanRequest().moveit_plan
    plan.joint_trajectory.joint_names = ["a"]
    plan.joint_trajectory.points = [JointTrajectoryPoint(positions=[0.0]), JointTrajectoryPoint(velocities=[0.0])]
    assert position_fault(plan) == ""
    for field in ("positions", "velocities", "accelerations", "effort"):
        plan.joint_trajectory.points[1] = JointTrajectoryPoint(**{field: [0.0] * 3})
        assert position_fault(plan) == f"joint_trajectory.points[1].{field} has 3 values for 1 names"
    plan.joint_trajectory.points = []
    plan.multi_dof_joint_trajectory.joint_names = ["base"]
    plan.multi_dof_joint_trajectory.points = [MultiDOFJointTrajectoryPoint(transforms=[Transform()])]
    plan.multi_dof_joint_trajectory.points[0].transforms[0].rotation.w = 1.0
    assert position_fault(plan) == ""
    plan.multi_dof_joint_trajectory.points[0].transforms *= 2
    assert position_fault(plan) == "multi_dof_joint_trajectory.points[0].transforms has 2 values for 1 names"
