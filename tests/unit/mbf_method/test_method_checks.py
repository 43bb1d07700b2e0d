# SPDX-License-Identifier: BSD-3-Clause
"""`check_method` names common misunderstandings in a sentence, and `create_method` creates a method without a fault."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mbf_method import Grasps, JointPath, grasp_method, planner
from mbf_method.check_method import main as check_main
from mbf_method.create_method import create_method
from mbf_method.create_method import main as create_main
from mbf_method.grasp_request import GraspRequest
from mbf_method.method_checks import check_grasp_method, check_planner, local_call
from mbf_method.path_request import PathRequest
from mbf_method.sample_inputs import grasp_requests, path_requests
from mbf_method.templates.grasp import new_method as good_grasps
from mbf_method.templates.planner import new_method as good_paths
from mbf_method.wire import pack

SOURCES = Path(__file__).parents[3] / "src/mbf_method/src"
PYTHON = ("/usr/bin/env", f"PYTHONPATH={SOURCES}", sys.executable)
FAULTY_PLANNER = str(Path(__file__).parent / "faulty_planner.py")


def turned(poses: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    result = poses.copy()
    result[:, :3, :3] = rotations
    return result


def in_camera(poses: np.ndarray, request: GraspRequest) -> np.ndarray:
    assert request.camera is not None
    return np.linalg.inv(request.camera.pose) @ poses


def moved(poses: np.ndarray, factor: float, offset: np.ndarray) -> np.ndarray:
    result = poses.copy()
    result[:, :3, 3] = factor * result[:, :3, 3] + offset
    return result


def wrong_order(rotation: np.ndarray) -> np.ndarray:
    """Returns the rotation that a reader of x, y, z, w makes from the quaternion of a rotation in w, x, y, z."""
    w = 0.5 * np.sqrt(max(0.0, 1 + np.trace(rotation)))
    vector = np.sqrt(np.maximum(0.0, (1 + 2 * np.diag(rotation) - np.trace(rotation)) / 4))
    signs = np.sign([1.0, rotation[0, 1] + rotation[1, 0] or 1.0, 1.0])
    x, y, z, w = w, *(vector * signs)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


GRASP_FAULTS: dict[str, Callable[[Grasps, GraspRequest], Any]] = {
    "they seem to be in millimetres": lambda g, r: moved(g.poses, 1000.0, np.zeros(3)),
    "they seem to be in the camera frame": lambda g, r: in_camera(g.poses, r),
    "they seem to be relative to the object": lambda g, r: moved(g.poses, 1.0, -r.target.points.mean(axis=0)),
    "x and y of the hand seem to be exchanged": lambda g, r: turned(
        g.poses, np.stack([g.poses[:, :3, 1], -g.poses[:, :3, 0], g.poses[:, :3, 2]], axis=-1)
    ),
    "the approach direction seems to be x": lambda g, r: turned(g.poses, np.roll(g.poses[:, :3, :3], 1, axis=-1)),
    "order w, x, y, z instead of x, y, z, w": lambda g, r: turned(
        g.poses, np.array([wrong_order(pose[:3, :3]) for pose in g.poses])
    ),
    "put a fingertip below the surface": lambda g, r: moved(g.poses, 1.0, np.array([0.0, 0.0, -0.03])),
}


@pytest.mark.parametrize("sentence", GRASP_FAULTS)
def test_a_wrong_frame_unit_or_axis_of_grasps_is_named(sentence: str) -> None:
    @grasp_method(camera=True)
    def faulty(request: GraspRequest) -> Grasps:
        grasps = good_grasps(request)
        return Grasps(request.frame, GRASP_FAULTS[sentence](grasps, request), grasps.scores, grasps.widths)

    findings = check_grasp_method(local_call(faulty), grasp_requests(camera=True))
    assert any(sentence in text for text in findings.faults), findings


def test_half_widths_are_named() -> None:
    @grasp_method
    def faulty(request: GraspRequest) -> Grasps:
        grasps = good_grasps(request)
        return Grasps(request.frame, grasps.poses, grasps.scores, grasps.widths / 2)

    findings = check_grasp_method(local_call(faulty), grasp_requests())
    assert any("the widths seem to be half widths" in text for text in findings.faults), findings


PATH_FAULTS: dict[str, Callable[[PathRequest], np.ndarray]] = {
    "seems to be in degrees": lambda r: np.degrees([r.start, r.goals[0]]),
    "seems to begin at the goal": lambda r: np.array([r.goals[0], r.start]),
    "the joints seem to have another order, it must be joint_1, joint_2, joint_3": lambda r: np.array(
        [r.start[::-1], r.goals[0][::-1]]
    ),
    "gave different results": lambda r: np.array([r.start, np.random.default_rng().uniform(-1, 1, 3), r.goals[0]]),
}


@pytest.mark.parametrize("sentence", PATH_FAULTS)
def test_a_wrong_unit_direction_or_order_of_a_path_is_named(sentence: str) -> None:
    @planner
    def faulty(request: PathRequest) -> JointPath:
        return JointPath(PATH_FAULTS[sentence](request))

    findings = check_planner(local_call(faulty), path_requests())
    assert any(sentence in text for text in findings.faults), findings


@pytest.mark.parametrize(
    ("kind", "lines"), [("grasp", "12 grasps"), ("planner", "path of 2 points"), ("policy", "8 actions")]
)
def test_a_created_method_passes_its_test_and_check_method(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str, lines: str
) -> None:
    assert create_main(["mine", "--kind", kind, "--into", str(tmp_path)]) == 0
    folder = tmp_path / "mine"
    use = "task.yaml" if kind == "policy" else "experiment.yaml"
    assert sorted(file.name for file in folder.iterdir()) == sorted([use, "mine.py", "test_mine.py"])
    assert f'["{sys.executable}", "{folder}/mine.py"]' in (folder / use).read_text()
    subprocess.run([*PYTHON, str(folder / "test_mine.py")], check=True, env={**os.environ, "PYTHONPATH": ""})
    assert check_main(["--kind", kind, "--", *PYTHON, str(folder / "mine.py")]) == 0
    printed = capsys.readouterr().out
    assert lines in printed and "No fault found." in printed


@pytest.mark.parametrize(("name", "error"), [("my-method", "must be a Python identifier"), ("mine", "exists; choose")])
def test_a_wrong_name_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, error: str) -> None:
    (tmp_path / "mine").mkdir()
    assert create_main([name, "--kind", "grasp", "--into", str(tmp_path)]) == 1
    assert error in capsys.readouterr().err


def test_recorded_inputs_replace_the_inputs_of_the_package(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--kind", "planner", "--inputs", str(tmp_path), "--", *PYTHON, FAULTY_PLANNER, "none"]
    assert check_main(arguments) == 1
    assert "contains no *.msgpack file" in capsys.readouterr().err
    (tmp_path / "0001.msgpack").write_bytes(pack(path_requests()[0]))
    assert check_main(arguments) == 0
    printed = capsys.readouterr().out
    assert "input 1: path of 2 points." in printed and "input 2" not in printed


def test_a_method_that_does_not_start_has_its_cause(capsys: pytest.CaptureFixture[str]) -> None:
    assert check_main(["--kind", "planner", "--", sys.executable, FAULTY_PLANNER, "exits"]) == 1
    assert "exited with code 3 before the method was ready" in capsys.readouterr().err


def test_the_templates_are_without_fault_in_this_process(tmp_path: Path) -> None:
    assert not check_grasp_method(local_call(good_grasps), grasp_requests()).faults
    assert not check_planner(local_call(good_paths), path_requests()).faults
    assert create_method("other", "grasp", tmp_path).name == "other"
