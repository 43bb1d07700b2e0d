# SPDX-License-Identifier: BSD-3-Clause
"""The collision matrix of a config package is computed anew, and nothing else of its SRDF changes."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from modular_framework_setup.commands.self_collision_command import main

BOX = '<link name="{0}"><collision><geometry><box size="{1}"/></geometry><origin xyz="{2}"/></collision></link>'
HINGE = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="{3}"/><axis xyz="0 0 1"/>'
    '<limit lower="{4}" upper="{5}" effort="1" velocity="1"/></joint>'
)
SLIDE = (
    '<joint name="{0}" type="prismatic"><parent link="palm"/><child link="{1}"/><origin xyz="0.1 {2} 0"/>'
    '<axis xyz="0 {3} 0"/><limit lower="0" upper="0.05" effort="1" velocity="1"/>{4}</joint>'
)
URDF = "".join(
    [
        '<robot name="folder">',
        BOX.format("base", "0.1 0.1 0.1", "0 0 0"),
        BOX.format("upper", "0.4 0.05 0.05", "0.2 0 0"),
        BOX.format("fore", "0.4 0.05 0.05", "0.2 0 0"),
        BOX.format("palm", "0.05 0.2 0.05", "0.05 0 0"),
        BOX.format("finger_1", "0.05 0.02 0.05", "0 0 0"),
        BOX.format("finger_2", "0.05 0.02 0.05", "0 0 0"),
        HINGE.format("shoulder", "base", "upper", "0 0 0.2", -3.0, 3.0),
        HINGE.format("elbow", "upper", "fore", "0.4 0 0", -3.1, 3.1),
        HINGE.format("wrist", "fore", "palm", "0.4 0 0", -2.5, 2.5),
        SLIDE.format("slide_1", "finger_1", 0.055, -1, ""),
        SLIDE.format("slide_2", "finger_2", -0.055, 1, '<mimic joint="slide_1"/>'),
        "</robot>",
    ]
)
"""An arm that folds in a plane above its base; its fingers meet."""
SRDF = """<?xml version="1.0"?>
<!-- Groups of the folding arm. -->
<robot name="folder">
  <group name="arm"><chain base_link="base" tip_link="palm"/></group>
  <group name="hand"><joint name="slide_1"/></group>
  <group_state name="open" group="hand"><joint name="slide_1" value="0"/></group_state>
  <group_state name="closed" group="hand"><joint name="slide_1" value="0.05"/></group_state>
  <end_effector name="hand" parent_link="palm" parent_group="arm" group="hand"/>
  <!-- Written by compute_self_collisions: long ago. -->
  <disable_collisions link1="base" link2="upper" reason="Never"/>
  <!-- <disable_collisions link1="base" link2="fore"/> -->
  <disable_collisions link1="palm" link2="upper" reason="User"></disable_collisions>
  <disable_collisions
      link1="fore" link2="upper" reason="Never"/>
  <passive_joint name="slide_2"/>
</robot>
"""
MATRIX = {
    ("base", "upper"): "Adjacent",
    ("fore", "upper"): "Adjacent",
    ("fore", "palm"): "Adjacent",
    ("finger_1", "palm"): "Adjacent",
    ("finger_2", "palm"): "Adjacent",
    ("finger_1", "finger_2"): "Default",
    ("base", "fore"): "Never",
    ("base", "palm"): "Never",
    ("base", "finger_1"): "Never",
    ("base", "finger_2"): "Never",
    ("palm", "upper"): "User",
}
CHECKED = {(finger, link) for finger in ("finger_1", "finger_2") for link in ("fore", "upper")}


@pytest.fixture
def package(tmp_path: Path) -> Path:
    folder = tmp_path / "folder_moveit_config"
    (folder / "config").mkdir(parents=True)
    (folder / "package.xml").write_text("<package><name>folder_moveit_config</name></package>")
    (folder / "config" / "folder.urdf").write_text(URDF)
    (folder / "config" / "folder.srdf").write_text(SRDF)
    return folder


def pairs(text: str) -> dict[tuple[str, str], str]:
    elements = ElementTree.fromstring(text).iter("disable_collisions")
    return {(each.attrib["link1"], each.attrib["link2"]): each.attrib["reason"] for each in elements}


def run(package: Path, *options: str) -> int:
    return main([str(package), "--samples", "300", *options])


def test_the_matrix_is_written_and_pairs_that_a_person_entered_stay(package: Path) -> None:
    assert run(package, "--write") == 0
    assert {tuple(sorted(pair)): reason for pair, reason in pairs(srdf(package)).items()} == {
        tuple(sorted(pair)): reason for pair, reason in MATRIX.items()
    }


def srdf(package: Path) -> str:
    return (package / "config" / "folder.srdf").read_text()


def test_everything_else_of_the_srdf_stays_as_it_is(package: Path) -> None:
    run(package, "--write")
    lines = [line for line in srdf(package).splitlines() if "<disable_collisions link" not in line or "<!--" in line]
    before, rest = SRDF.split("  <!-- Written")
    comment = "  <!-- Written by compute_self_collisions: 300 random states, seed 1, exact meshes. -->\n"
    kept = '  <!-- <disable_collisions link1="base" link2="fore"/> -->\n  <passive_joint name="slide_2"/>\n</robot>\n'
    assert "\n".join(lines) + "\n" == before + comment + kept
    written = srdf(package)
    run(package, "--write")
    assert srdf(package) == written


def test_without_the_option_the_matrix_is_printed_with_the_pairs_that_are_checked(
    package: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(package) == 0
    printed = capsys.readouterr()
    assert srdf(package) == SRDF
    run(package, "--write")
    assert pairs(f"<robot>{printed.out}</robot>") == pairs(srdf(package))
    assert all(f"checked: {one} {other} (" in printed.out for one, other in CHECKED)
    assert "11 of 15 pairs of links need no check" in printed.err


def test_an_srdf_without_a_matrix_gets_one_at_its_end(package: Path) -> None:
    (package / "config" / "folder.srdf").write_text(
        '<robot name="folder"><group name="a"><joint name="wrist"/></group></robot>\n'
    )
    assert run(package, "--write") == 0
    assert srdf(package).index("<group") < srdf(package).index("<disable_collisions") < srdf(package).index("</robot>")
    assert pairs(srdf(package)).get(("finger_1", "finger_2")) != "Default"  # nothing says that they are a hand


@pytest.mark.parametrize(
    ("file", "text", "options", "message"),
    [
        ("folder.srdf", SRDF, ["--samples", "0"], "--samples is 0; allowed: 1 or more"),
        ("folder.srdf", '<robot name="folder"/>', ["--write"], r"folder.srdf: the SRDF has no closing </robot> tag"),
        (
            "folder.srdf",
            '<robot name="folder" xmlns:xacro="http://www.ros.org/wiki/xacro"><!-- of two arms --></robot>',
            ["--write"],
            "folder.srdf is a xacro file; print the matrix",
        ),
        ("folder.srdf", SRDF.replace('group="hand"/>\n  <!-- W', 'group="hnd"/>\n  <!-- W'), [], "'hnd'"),
        ("folder.urdf", "<robot", [], "not well-formed"),
        ("other.srdf", SRDF, [], "2 files may be the semantic description"),
    ],
)
def test_what_cannot_be_computed_is_refused_and_nothing_is_written(
    package: Path, capsys: pytest.CaptureFixture[str], file: str, text: str, options: list[str], message: str
) -> None:
    (package / "config" / file).write_text(text)
    before = srdf(package)
    assert main([str(package), *options]) == 1
    said = capsys.readouterr().err
    assert said.startswith("compute_self_collisions: ") and message in said
    assert srdf(package) == before


def test_a_package_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["no_such_moveit_config"]) == 1
    assert "'no_such_moveit_config' is neither a folder nor a ROS package" in capsys.readouterr().err
