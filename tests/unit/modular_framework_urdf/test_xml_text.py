# SPDX-License-Identifier: BSD-3-Clause
"""A DOCTYPE is refused by every reader of descriptions, with file and line, before an entity is expanded."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError, parse, refuse_doctype

SOURCES = Path(__file__).parents[3] / "src"
LEVELS = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 30}">' for n in range(1, 12))
BOMB = f'<?xml version="1.0"?>\n<!DOCTYPE robot [<!ENTITY e0 "boom">{LEVELS}]>\n'
"""30 to the power of 11 words, were they expanded."""


@pytest.mark.parametrize("kind", [str, str.encode, lambda text: text.encode("utf-16")], ids=["text", "bytes", "utf-16"])
def test_a_doctype_is_refused_where_it_stands(kind: Callable[[str], Any]) -> None:
    with pytest.raises(XmlError, match=r"^arm\.urdf:2: got a DOCTYPE; allowed: XML without a DOCTYPE, .*; remove it$"):
        parse(kind(BOMB + "<robot>&e11;</robot>"), "arm.urdf")
    refuse_doctype(kind("<robot/><!DOCTYPE robot>"), "behind the root it is a fault that the parser names")


def test_what_only_looks_like_one_is_read() -> None:
    root = parse("<!-- <!DOCTYPE a> -->\n<a b='&lt;!DOCTYPE'><![CDATA[<!DOCTYPE a>]]></a>", "x")
    assert (root.get("b"), root.text) == ("<!DOCTYPE", "<!DOCTYPE a>")
    with pytest.raises(XmlError, match=r"^x:3: not an XML document .*; it must be well-formed XML; correct it$"):
        parse("<a>\n\n</b>", "x")


def test_a_doctype_does_not_hide_in_an_encoding_that_expat_cannot_read() -> None:
    for encoding in ("utf-32", "gb2312"):
        declared = BOMB.replace("?>", f' encoding="{encoding}"?>', 1)
        with pytest.raises(XmlError, match=r"^x:1: not an XML document"):
            parse((declared + "<robot>&e11;</robot>").encode(encoding), "x")


def test_names_stand_as_written_without_their_namespace() -> None:
    root = parse('<sdf><plugin><ignition:foo a:b="1"/></plugin><a xmlns="u"><b/></a></sdf>', "x")
    assert [element.tag for element in root.iter()] == ["sdf", "plugin", "ignition:foo", "a", "b"]
    assert root[0][0].get("a:b") == "1"
    for wrong in (
        "<a><x:y></a>",
        '<a xmlns="u"><x::y/></a>',
        "<a>" + "<x:y/>" * 300 + "</a>b",
        "<a>" + "<x:y/>" * 300 + "\ud800</a>",
    ):
        with pytest.raises(XmlError, match="^x:1: not an XML document"):
            parse(wrong, "x")
    with pytest.raises(XmlError, match="depth"):
        parse("<a>" + "<x:y/>" * 300 + "<a>" * 300 + "</a>" * 301, "x")


def test_the_line_of_an_element_is_where_its_start_tag_begins() -> None:
    root = parse('<a>\n<b\n c="1"\n d="2"><e/>\n</b></a>' + "\n" * 70_000, "x")
    assert [element.sourceline for element in root.iter()] == [1, 2, 4]
    assert parse("<a>" + "\n" * 70_000 + "<b/>\n</a>", "x")[0].sourceline >= 70_001


def _planning_urdf(text: str, _folder: Path) -> None:
    from modular_framework_planning.robot_model.urdf_document import load_urdf

    load_urdf(text)


def _planning_srdf(text: str, _folder: Path) -> None:
    from modular_framework_planning.robot_model.srdf import parse_srdf

    parse_srdf(text)


def _control(text: str, _folder: Path) -> None:
    from modular_framework_control.hardware_interface.urdf_xml import parse_description

    parse_description(text)


def _plugins(text: str, folder: Path) -> None:
    from modular_framework_control.hardware_interface.plugins import read_description

    read_description(_file(folder, "plugins.xml", text))


def _core_bounds(text: str, _folder: Path) -> None:
    from modular_framework_core.managers.joint_bounds import bounds_from_urdf

    bounds_from_urdf(text)


def _core_groups(text: str, _folder: Path) -> None:
    from modular_framework_core.commander.robot_groups import read_group

    read_group(text, "<robot/>", "arm")


def _core_gripper(text: str, _folder: Path) -> None:
    from modular_framework_core.grasp_generation.gripper_geometry import measure_gripper

    measure_gripper(text, "palm", "finger")


def _simulated_robot(text: str, folder: Path) -> None:
    from modular_framework_simulation.models.mesh_files import ConvexParts
    from modular_framework_simulation.robots.robot_description import read_robot

    read_robot(text, str, ConvexParts(folder), False)


def _simulated_sdf(text: str, _folder: Path) -> None:
    from modular_framework_simulation.models.sdf_reader import read_model_text
    from modular_framework_simulation.models.sdf_resources import Resources

    read_model_text(text, "request", Resources((), str))


def _simulated_urdf(text: str, _folder: Path) -> None:
    from modular_framework_simulation.models.sdf_resources import Resources
    from modular_framework_simulation.models.urdf_model import read_urdf_model

    read_urdf_model(text, "request", Resources((), str))


def _world_file(text: str, folder: Path) -> None:
    from modular_framework_simulation.models.sdf_reader import read_world
    from modular_framework_simulation.models.sdf_resources import Resources

    read_world(_file(folder, "table.world", text), Resources((), str))


def _mesh(text: str, folder: Path) -> None:
    from modular_framework_urdf.mesh_reader import read_mesh

    read_mesh(_file(folder, "hand.dae", text))


def _commander(text: str, _folder: Path) -> None:
    from moveit_commander.robot_model import RobotModel

    RobotModel(text, "<robot/>")


def _xacro(text: str, folder: Path) -> None:
    expand = pytest.importorskip("xacro_rospkg", reason="source the workspace").expand
    expand(_file(folder, "arm.xacro", text))


def _included_xacro(text: str, folder: Path) -> None:
    expand = pytest.importorskip("xacro_rospkg", reason="source the workspace").expand
    inner = _file(folder, "hand.xacro", text)
    expand(_file(folder, "arm.xacro", f'<robot xmlns:xacro="http://x"><xacro:include filename="{inner}"/></robot>'))


def _file(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


READERS = (
    _planning_urdf,
    _planning_srdf,
    _control,
    _plugins,
    _core_bounds,
    _core_groups,
    _core_gripper,
    _simulated_robot,
    _simulated_sdf,
    _simulated_urdf,
    _world_file,
    _mesh,
    _commander,
    _xacro,
    _included_xacro,
)


@pytest.mark.parametrize("read", READERS, ids=lambda reader: reader.__name__[1:])
def test_every_reader_refuses_it(read: Callable[[str, Path], None], tmp_path: Path) -> None:
    with pytest.raises(Exception, match=r"\S+:2: got a DOCTYPE; allowed: .*; remove it"):
        read(BOMB + "<robot name='r'>&e11;</robot>", tmp_path)


def test_no_module_parses_xml_past_the_check() -> None:
    parsers = re.compile(r"(?:ElementTree|ET)\.(?:parse|fromstring|XML|iterparse)\(|minidom|lxml|ParserCreate\(")
    found = {path.name for path in SOURCES.rglob("*.py") if parsers.search(path.read_text())}
    checked = {path.name for path in SOURCES.rglob("*.py") if "refuse_doctype(" in path.read_text()}
    assert found <= checked and "xml_text.py" in found


@pytest.mark.parametrize("namespace", ["xmlns:xacro='http://www.ros.org/wiki/xacro'", ""])
def test_xacro_that_is_not_expanded_is_no_robot(namespace: str) -> None:
    text = f"<robot name='r' {namespace}>\n<xacro:property name='x' value='1'/><link name='base'/></robot>"
    with pytest.raises(XmlError, match="robot_description:2: this is xacro; allowed: URDF; expand the file with xacro"):
        read_urdf(text)
