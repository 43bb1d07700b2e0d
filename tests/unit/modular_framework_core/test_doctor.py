# SPDX-License-Identifier: BSD-3-Clause
"""Findings of the command `doctor` about installation and configuration, and its report."""

from __future__ import annotations

import ast
import getpass
import os
import re
import shutil
import socket
import subprocess
from importlib import metadata
from pathlib import Path

import pytest

from modular_framework_core.diagnosis import ros_doctor
from modular_framework_core.diagnosis.findings import Level, fault, ok, without_private_data
from modular_framework_core.diagnosis.installation import find_checkout, installation_findings
from modular_framework_testing.ros_session import free_port

ROOT = Path(__file__).parents[3]
SOURCES = ROOT / "src/modular_framework_core/src/modular_framework_core/diagnosis"


def checkout(folder: Path, debian: str, python: str) -> Path:
    (folder / "packages-debian.txt").write_text(debian)
    (folder / "requirements.txt").write_text(python)
    return folder


def test_packages_that_are_missing_or_have_another_version_are_named_with_a_remedy(tmp_path: Path) -> None:
    wanted = "numpy==0.0.1\n    # via scipy\nnot-a-package==2.0\n"
    found = list(installation_findings(checkout(tmp_path, "# shell\nbash\nno-such-package\n", wanted), tmp_path))
    texts = [finding.text for finding in found if finding.level is Level.FAULT]
    assert texts == [
        "1 Debian packages are missing: no-such-package.",
        f"2 of 2 Python packages differ from requirements.txt: numpy {metadata.version('numpy')} instead of 0.0.1, "
        "not-a-package none instead of 2.0.",
    ]
    assert all(finding.remedy for finding in found if finding.level is Level.FAULT)


def test_the_packages_of_this_installation_are_complete(tmp_path: Path) -> None:
    assert find_checkout(ROOT / "src/modular_framework_api") == ROOT
    found = list(installation_findings(ROOT, tmp_path / "records"))
    assert [finding for finding in found[:2] if finding.level is not Level.OK] == []


def test_every_fault_refers_to_a_section_of_the_page_on_troubleshooting() -> None:
    page = (ROOT / "docs/troubleshooting.md").read_text()
    sections = {title.lower().replace(" ", "-") for title in re.findall(r"^## (.+)$", page, re.MULTILINE)}
    calls = [node for file in SOURCES.glob("*.py") for node in ast.walk(ast.parse(file.read_text())) if is_fault(node)]
    anchors = [call.args[2].value for call in calls if isinstance(call.args[2], ast.Constant)]
    assert len(anchors) == len(calls) > 10
    assert set(anchors) <= sections


def is_fault(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "fault"


def test_a_finding_is_wrapped_below_its_level() -> None:
    lines = fault("word " * 40, "./install.sh", "start").lines()
    assert lines[0].startswith("  FAULT  word") and lines[1].startswith("         word")
    assert lines[-2:] == ["         What to do: ./install.sh", "         See docs/troubleshooting.md#start"]
    assert ok("All is well.").lines() == ["  ok     All is well."]


def test_a_report_names_no_user_host_home_or_address(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/jane")
    monkeypatch.setattr(getpass, "getuser", lambda: "jane")
    monkeypatch.setattr(socket, "gethostname", lambda: "lab-3")
    text = without_private_data("jane@lab-3: /home/jane/.ros at 192.168.1.20 and 127.0.0.1; janet, lab-31")
    assert text == "USER@HOST: ~/.ros at ADDRESS and 127.0.0.1; janet, lab-31"


def test_the_faults_of_a_launch_are_findings_and_set_the_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{free_port()}")
    monkeypatch.setattr(ros_doctor, "installation_findings", lambda checkout, records: [ok("installed")])
    report = tmp_path / "report.txt"
    arguments = ["planer_name:=RRTConnect", "--report", str(report)]
    assert ros_doctor.main(arguments, lambda path, arguments: []) == 1
    printed = capsys.readouterr().out
    assert "FAULT  unknown argument 'planer_name'; did you mean 'planner_name'?" in printed
    assert "No ROS master runs there" in printed
    assert "unknown argument 'planer_name'" in report.read_text() and "Python: " in report.read_text()
    assert ros_doctor.main([], lambda path, arguments: []) == 0
    assert ros_doctor.main([], lambda path, arguments: ["planner 'RRTConect' is unknown"]) == 1


def test_the_faults_of_the_config_package_are_findings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped = ROOT / "src/robots/ur5_ezgripper_moveit_config"
    shutil.copytree(shipped, tmp_path / "lab_config")
    for name, old, new in (
        ("package.xml", "<name>ur5_ezgripper_moveit_config</name>", "<name>lab_config</name>"),
        ("config/ur5_with_ezgripper.srdf", 'link1="wrist_1_link"', 'link1="wrist_9_link"'),
    ):
        file = tmp_path / "lab_config" / name
        text = file.read_text()
        assert old in text
        file.write_text(text.replace(old, new, 1))
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path}:{os.environ['ROS_PACKAGE_PATH']}")
    monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{free_port()}")
    command = ["rosrun", "modular_framework_setup", "doctor"]
    run = subprocess.run([*command, "moveit_config_package:=lab_config"], capture_output=True, text=True, check=False)
    assert run.returncode == 1 and "FAULT  lab_config:" in run.stdout and "wrist_9_link" in run.stdout, run.stderr
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "the MoveIt config package have no fault" in run.stdout, run.stdout + run.stderr
