# SPDX-License-Identifier: BSD-3-Clause
"""Elements and attributes that SDF does not define are named with their line, and the nearest name."""

from __future__ import annotations

from pathlib import Path

import pytest
import rospkg

from modular_framework_simulation.models.sdf_elements import CHILDREN, children_of, unknown_content
from modular_framework_simulation.models.sdf_notes import SUPPORTED_CHILDREN
from modular_framework_simulation.models.sdf_reader import read_model_text, read_world
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.xml_nodes import parse_xml, read_xml

LINK = """<link name="l"><collision name="c"><geometry><box><size>1 1 1</size></box></geometry>
<surface><friction><ode><mu>0.5</mu></ode></friction></surface></collision></link>"""
MODEL = f'<sdf version="1.6"><model name="m"><static>1</static>\n{LINK}</model></sdf>'


@pytest.mark.parametrize(
    ("old", "new", "place", "what", "meant"),
    [
        ("<friction>", "<frictoin/><friction>", "3: <frictoin>", "<frictoin> in <surface>", "friction"),
        ("<mu>", "<mmu>1</mmu><mu>", "3: <mmu>", "<mmu> in <ode>", "mu"),
        ("<size>", "<sise>1</sise><size>", "2: <sise>", "<sise> in <box>", "size"),
        ("<static>", "<modl name='n'/><static>", "1: <modl name='n'>", "<modl> in <model>", "model"),
        ("<link ", "<pose relatve_to='l'/><link ", "2: <pose>", "attribute 'relatve_to'", "relative_to"),
    ],
)
def test_a_misspelt_name_is_found_with_its_line_and_the_nearest_name(
    old: str, new: str, place: str, what: str, meant: str
) -> None:
    assert unknown_content(parse_xml(MODEL, "t")) == ()
    found = unknown_content(parse_xml(MODEL.replace(old, new, 1), "t"))
    assert found == (f"t:{place}: SDF defines no {what}; did you mean '{meant}'?",)


@pytest.mark.parametrize(
    "text",
    [
        "<plugin name='p' filename='x.so' speed='3'><my_gain>1</my_gain></plugin>",
        "<drake:joint xmlns:drake='d' my_attribute='1'><gain/></drake:joint>",
        "<ignition:fast>1</ignition:fast>",
    ],
)
def test_content_of_plugins_and_of_other_programs_is_not_checked(text: str) -> None:
    assert unknown_content(parse_xml(MODEL.replace("<static>", f"{text}<static>"), "t")) == ()


def test_a_spawned_model_has_a_note_on_each_unknown_element() -> None:
    model = read_model_text(MODEL.replace("<friction>", "<frictoin/><friction>"), "t", Resources())
    assert "t:3: <frictoin>: SDF defines no <frictoin> in <surface>; did you mean 'friction'?" in model.notes


def test_a_world_names_the_unknown_elements_of_its_included_models(tmp_path: Path) -> None:
    (tmp_path / "crate").mkdir()
    (tmp_path / "crate" / "model.sdf").write_text(MODEL.replace("<size>", "<sise/><size>"))
    path = tmp_path / "own.world"
    include = "<include><uri>model://crate</uri></include>"
    path.write_text(f'<sdf version="1.6"><world name="w"><gravty>0 0 0</gravty>\n{include}</world></sdf>')
    world = read_world(path, Resources((tmp_path,)))
    first, second = world.unknown
    assert first == f"{path}:1: <gravty>: SDF defines no <gravty> in <world>; did you mean 'gravity'?"
    assert second.startswith(f"{tmp_path}/crate/model.sdf:2: <sise>")
    assert world.ignored == () and [model.name for model in world.models] == ["m"]


def test_every_element_with_an_effect_is_one_that_sdf_defines() -> None:
    for path, children in SUPPORTED_CHILDREN.items():
        assert set(children) <= children_of(path), path
    assert "frictoin" not in children_of("sdf/model/link/collision/surface")
    assert all(children for children in CHILDREN.values())


def test_the_shipped_worlds_and_models_have_only_what_sdf_defines() -> None:
    package = Path(rospkg.RosPack().get_path("modular_framework_description"))
    files = [*package.glob("worlds/*.world"), *package.glob("models/**/*.sdf")]
    assert len(files) > 30
    assert [line for file in files for line in unknown_content(read_xml(file))] == []
