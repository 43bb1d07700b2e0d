# SPDX-License-Identifier: BSD-3-Clause
"""Classes of other packages are found by their plugin names, and faults are reported."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from modular_framework_control.hardware_interface.combined_robot_hw import robot_hw_of_type
from modular_framework_control.hardware_interface.plugins import (
    CONTROLLER_BASE,
    ROBOT_HW_BASE,
    PluginError,
    PluginIndex,
    read_description,
)
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.hardware_interface.workspace_packages import packages_of_workspace

CLASS = '<class name="{name}" type="{cls}" base_class_type="{base}"/>'
MODULE = """
from modular_framework_control.hardware_interface.robot_hw import RobotHW

class LabArm(RobotHW):
    pass

class NoArm:
    pass
"""


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., PluginIndex]]:
    """Makes a package lab_arms whose description holds the given classes; returns an index that sees it."""
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "lab_arms_hw.py").write_text(MODULE)

    def make(*classes: tuple[str, str, str], module: str = "lab_arms_hw", base: str = ROBOT_HW_BASE) -> PluginIndex:
        entries = "".join(CLASS.format(name=name, cls=cls, base=kind) for name, cls, kind in classes)
        (tmp_path / "package.xml").write_text(
            '<package><export><modular_framework_control plugin="${prefix}/p.xml"/></export></package>'
        )
        (tmp_path / "p.xml").write_text(f'<library path="{module}">{entries}</library>')
        return PluginIndex(base, lambda: {"lab_arms": tmp_path, "nothing_here": tmp_path / "absent"})

    yield make


def test_a_class_is_found_under_the_name_its_package_offers(lab: Callable[..., PluginIndex]) -> None:
    index = lab(("lab_arms/LabArm", "LabArm", ROBOT_HW_BASE), ("lab_arms/Mover", "Mover", CONTROLLER_BASE))
    assert index.names == ["lab_arms/LabArm"]
    hardware = robot_hw_of_type("lab_arms/LabArm", index)
    assert isinstance(hardware, RobotHW) and type(hardware).__name__ == "LabArm"


def test_an_unknown_name_is_answered_with_the_known_ones_and_the_faults(
    lab: Callable[..., PluginIndex], tmp_path: Path
) -> None:
    index = lab(("lab_arms/LabArm", "LabArm", ROBOT_HW_BASE))
    with pytest.raises(
        PluginError, match=r"'lab_arms/Leg'; known: lab_arms/LabArm\. A package.*; did you mean 'lab_arms/LabArm'\?$"
    ):
        index.load("lab_arms/Leg", RobotHW)
    (tmp_path / "p.xml").write_text("<library")
    index.reload()
    with pytest.raises(PluginError, match="known: none; faulty descriptions: plugin description .*p.xml"):
        index.load("lab_arms/LabArm", RobotHW)


@pytest.mark.parametrize(
    ("tag", "base"), [("hardware_interface", ROBOT_HW_BASE), ("controller_interface", CONTROLLER_BASE)]
)
def test_a_cpp_class_is_refused_as_such(lab: Callable[..., PluginIndex], tmp_path: Path, tag: str, base: str) -> None:
    index = lab(("lab_arms/Cpp", "lab_arms::Cpp", base), module="lib/liblab_arms", base=base)
    manifest = tmp_path / "package.xml"
    manifest.write_text(manifest.read_text().replace("modular_framework_control", tag))
    assert index.names == []
    with pytest.raises(
        PluginError, match=r"lab_arms/Cpp is a C\+\+ class \(library lib/liblab_arms, offered by .*p.xml\)"
    ):
        index.load("lab_arms/Cpp", RobotHW)
    with pytest.raises(PluginError, match="no package of this workspace offers"):
        index.load("lab_arms/Other", RobotHW)


@pytest.mark.parametrize(
    ("library", "cls"), [("lib/liblab_arms", "Cpp"), ("liblab_arms.so", "Cpp"), ("liblab_arms", "lab_arms::Cpp")]
)
def test_a_cpp_class_under_the_tag_of_python_classes_is_refused_as_such(
    lab: Callable[..., PluginIndex], library: str, cls: str
) -> None:
    index = lab(("lab_arms/Cpp", cls, ROBOT_HW_BASE), module=library)
    with pytest.raises(PluginError, match=rf"lab_arms/Cpp is a C\+\+ class \(library {library}, offered by .*p.xml\)"):
        index.load("lab_arms/Cpp", RobotHW)


def test_a_module_that_was_changed_is_imported_anew_after_a_reload(
    lab: Callable[..., PluginIndex], tmp_path: Path
) -> None:
    index = lab(("lab_arms/Tool", "Tool", ROBOT_HW_BASE), module="lab_arms_tool")
    for length in ("short", "a good deal longer"):
        (tmp_path / "lab_arms_tool.py").write_text(f"{MODULE}\nclass Tool(RobotHW):\n    length = {length!r}\n")
        index.reload()
        assert index.load("lab_arms/Tool", RobotHW).length == length
        assert index.load("lab_arms/Tool", RobotHW) is index.load("lab_arms/Tool", RobotHW)


@pytest.mark.parametrize(
    ("cls", "module", "words"),
    [
        ("Absent", "lab_arms_hw", "AttributeError"),
        ("LabArm", "lab_arms_absent", "ModuleNotFoundError"),
        (
            "NoArm",
            "lab_arms_hw",
            "is not a RobotHW; derive it from modular_framework_control.hardware_interface.robot_hw.RobotHW",
        ),
    ],
)
def test_a_class_that_cannot_be_loaded_is_reported_with_its_origin(
    lab: Callable[..., PluginIndex], cls: str, module: str, words: str
) -> None:
    index = lab(("lab_arms/LabArm", cls, ROBOT_HW_BASE), module=module)
    with pytest.raises(PluginError, match=words) as caught:
        index.load("lab_arms/LabArm", RobotHW)
    assert "offered as lab_arms/LabArm by" in str(caught.value)


def test_all_faults_of_a_description_are_reported_at_once(tmp_path: Path) -> None:
    path = tmp_path / "p.xml"
    path.write_text(
        '<plugins><library path="m"><class name="a/A"/><class name="B" type="B" base_class_type="c"/>'
        "</library></plugins>"
    )
    with pytest.raises(PluginError, match="'a/A': no type, base_class_type; class 'B': its name must have the form"):
        read_description(path)


def test_two_packages_with_one_name_are_reported(lab: Callable[..., PluginIndex], tmp_path: Path) -> None:
    entry = ("lab_arms/LabArm", "LabArm", ROBOT_HW_BASE)
    assert "already offered by" in lab(entry, entry).faults[0]


def test_a_broken_manifest_is_reported_and_hides_no_other_package(
    lab: Callable[..., PluginIndex], tmp_path: Path
) -> None:
    lab(("lab_arms/LabArm", "LabArm", ROBOT_HW_BASE))
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "package.xml").write_text("<package><export><modular_framework_control")
    index = PluginIndex(ROBOT_HW_BASE, lambda: {"broken": broken, "lab_arms": tmp_path})
    assert "lab_arms/LabArm" in index and "of package broken" in index.faults[0]


def test_the_fake_hardware_is_offered_by_this_workspace() -> None:
    assert "modular_framework_control" in packages_of_workspace()
    assert type(robot_hw_of_type("modular_framework_control/MockRobotHW")).__name__ == "MockRobotHW"
