# SPDX-License-Identifier: BSD-3-Clause
"""The test of layers finds every kind of import that its table forbids, and draws what it found."""

from __future__ import annotations

import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from catkin_pkg.packages import find_packages

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tests" / "layers"))

from architecture_drawing import dot_text, draw, is_up_to_date, without_shortcuts  # noqa: E402
from imports_of_tests import imports_of_tests, python_files  # noqa: E402
from layer_checks import find_faults  # noqa: E402
from layer_table import LayerTable, TableError, make_layer_table, read_layer_table  # noqa: E402
from source_tree import SourceTree, read_source_tree  # noqa: E402


def table(**changes: object) -> LayerTable:
    """Makes a table for two packages, `house` with three rooms above `ground`."""
    text = {
        "max_modules_in_a_folder": 3,
        "ros": ["rospy"],
        "ground_floor": ["ground"],
        "packages": {"house": [], "ground": []},
        "rooms": {"house": ["cellar", ["kitchen", "bedroom"], "roof"]},
        "ros_interface": {"house": ["roof"]},
    }
    return make_layer_table(text | changes)


def tree(folder: Path, modules: dict[str, str]) -> SourceTree:
    """Writes packages with these modules besides the empty rooms of the table, and reads them."""
    packages = dict.fromkeys(["ground", "house", *(name.partition(".")[0] for name in modules)], "")
    above = [name.rpartition(".")[0] for name in modules if name.count(".") > 1]
    rooms = dict.fromkeys(["house.cellar", "house.kitchen", "house.bedroom", "house.roof", *above], "")
    for name, text in (packages | rooms | modules).items():
        package, *inside = name.split(".")
        file = folder.joinpath("src", package, "src", package, *inside)
        file = file / "__init__.py" if name in packages | rooms else file.with_suffix(".py")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return read_source_tree(folder / "src")


def faults(folder: Path, modules: dict[str, str], rules: LayerTable | None = None) -> list[str]:
    return find_faults(tree(folder, modules), rules or table())


def test_imports_that_run_down_pass(tmp_path: Path) -> None:
    modules = {
        "house.roof.tiles": "import rospy\nfrom house.kitchen import stove\nfrom ground import stone",
        "house.kitchen.stove": "import house.cellar.coal",
        "house.cellar.coal": "",
        "ground.stone": "import math",
    }
    assert faults(tmp_path, modules) == []


def test_an_import_that_runs_upwards_fails_in_four_parts(tmp_path: Path) -> None:
    modules = {"house.kitchen.stove": "\nimport house.roof.chimney", "house.roof.chimney": ""}
    assert faults(tmp_path, modules) == [
        "src/house/src/house/kitchen/stove.py:2: house's room 'kitchen' imports house.roof.chimney; "
        "allowed: cellar; move what is shared down, or pass it in",
        "src/house/src/house/kitchen/stove.py:2: house.kitchen.stove imports house.roof.chimney below the ROS "
        "interface; "
        "allowed: in ros_*, roof of the package; move it to the ROS interface, or pass in what it needs",
    ]


@pytest.mark.parametrize(
    "text",
    [
        "def cook():\n    from house.bedroom import bed",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from house.bedroom.bed import Bed",
        "from ..bedroom import bed",
    ],
)
def test_imports_in_functions_for_types_and_relative_ones_count(tmp_path: Path, text: str) -> None:
    (found,) = faults(tmp_path, {"house.kitchen.stove": text, "house.bedroom.bed": "class Bed: pass"})
    assert f"stove.py:{len(text.splitlines())}: house's room 'kitchen' imports house.bedroom.bed" in found


def test_the_file_that_opens_a_room_may_import_its_modules(tmp_path: Path) -> None:
    assert faults(tmp_path, {"house.kitchen": "import house.kitchen.stove", "house.kitchen.stove": ""}) == []


def test_rooms_of_a_room_have_an_order_too(tmp_path: Path) -> None:
    rules = table(rooms={"house": ["cellar", ["kitchen", "bedroom"], "roof"], "house.kitchen": [["stove", "sink"]]})
    modules = {"house.kitchen.stove.pot": "import house.kitchen.sink.tap", "house.kitchen.sink.tap": ""}
    (found,) = faults(tmp_path, modules, rules)
    assert "house.kitchen's room 'stove' imports house.kitchen.sink.tap; allowed: no other room" in found


def test_the_modules_directly_in_a_folder_are_a_room(tmp_path: Path) -> None:
    rules = table(rooms={"house": [".", "cellar", ["kitchen", "bedroom"], "roof"]})
    modules = {"house.walls": "", "house.doors": "import house.walls", "house.cellar.coal": "import house.doors"}
    assert faults(tmp_path, modules, rules) == []
    (found,) = faults(tmp_path, modules | {"house.walls": "import house.cellar.wood", "house.cellar.wood": ""}, rules)
    assert "house's room '.' imports house.cellar.wood; allowed: no other room" in found


@pytest.mark.parametrize("text", ["import house.cellar.gold", "from house.cellar.gold import bar"])
def test_an_import_of_a_module_that_does_not_exist_fails(tmp_path: Path, text: str) -> None:
    (found,) = faults(tmp_path, {"house.kitchen.stove": text})
    assert found.startswith("src/house/src/house/kitchen/stove.py:1: imports house.cellar.gold, which does not exist")


def test_an_import_between_packages_has_to_be_in_the_table(tmp_path: Path) -> None:
    (found,) = faults(tmp_path, {"ground.stone": "import house.cellar.coal", "house.cellar.coal": ""})
    assert found == (
        "src/ground/src/ground/stone.py:1: ground imports house.cellar.coal; allowed: no package; "
        "move what is shared into a package below both, or pass it in"
    )


@pytest.mark.parametrize("importer", ["house.cellar.coal", "ground.stone"])
def test_rospy_below_the_ros_interface_fails(tmp_path: Path, importer: str) -> None:
    (found,) = faults(tmp_path, {importer: "def now():\n    import rospy"})
    assert f"{importer} imports rospy below the ROS interface" in found
    assert ".py:2: " in found


@pytest.mark.parametrize(
    "text", ["from sensor_msgs.msg import Image", "from ground.msg import Stone", "from ground import srv"]
)
def test_messages_below_the_ros_interface_fail(tmp_path: Path, text: str) -> None:
    (found,) = faults(tmp_path, {"ground.stone": text}, table(ros=["*_msgs", "*.msg", "*.srv"]))
    assert "below the ROS interface" in found


def test_a_module_called_ros_may_import_rospy_but_not_be_imported_from_below_the_ros_interface(tmp_path: Path) -> None:
    (found,) = faults(tmp_path, {"ground.ros_clock": "import rospy", "ground.time": "import ground.ros_clock"})
    assert "ground.time imports ground.ros_clock below the ROS interface" in found


def test_a_circle_of_files_fails_inside_one_room(tmp_path: Path) -> None:
    modules = {
        "house.cellar.coal": "from house.cellar.wood import x",
        "house.cellar.wood": "def burn():\n    import house.cellar.ash",
        "house.cellar.ash": "import house.cellar.coal",
    }
    (found,) = faults(tmp_path, modules)
    assert found == (
        "src/house/src/house/cellar/ash.py:1: the circle house.cellar.ash -> house.cellar.coal -> house.cellar.wood "
        "-> house.cellar.ash; allowed: no circle of files; move what they share into a module below both, or pass it in"
    )


def test_a_folder_of_too_many_modules_fails(tmp_path: Path) -> None:
    (found,) = faults(tmp_path, {f"house.cellar.barrel{number}": "" for number in range(4)})
    assert found.startswith("src/house/src/house/cellar: 4 modules in one folder; allowed: at most 3; ")


@pytest.mark.parametrize(
    ("module", "message"),
    [
        ("shed.tools", "src/shed: the table has no entry for package 'shed'"),
        ("house.garage.car", "src/house/src/house/garage: 'garage' is not one of the rooms of house"),
        ("house.walls", "src/house/src/house: modules lie outside every room; allowed: bedroom, cellar, "),
        ("ground.rocks.granite", "src/ground/src/ground/rocks: 'rocks' is not one of the rooms of ground"),
        ("house.kitchen.stove.pot", "src/house/src/house/kitchen/stove: 'stove' is not one of the"),
    ],
)
def test_packages_and_rooms_that_the_table_does_not_know_fail(tmp_path: Path, module: str, message: str) -> None:
    rules = table(rooms={"house": ["cellar", ["kitchen", "bedroom"], "roof"], "house.kitchen": ["sink"]})
    found = faults(tmp_path, {module: "", "house.kitchen.sink.tap": ""}, rules)
    assert [text for text in found if text.startswith(message)]


def test_a_room_of_the_table_that_is_gone_fails(tmp_path: Path) -> None:
    (found,) = faults(tmp_path, {}, table(rooms={"house": ["vault", "cellar", "kitchen", "bedroom", "roof"]}))
    assert "house has no room 'vault'" in found


def test_a_pattern_stands_for_the_packages_of_a_folder(tmp_path: Path) -> None:
    modules = {"shed.tools": "import house.cellar.coal", "house.cellar.coal": ""}
    assert faults(tmp_path, modules, table(packages={"*": ["house"]})) == []


def test_an_exempted_import_passes_with_its_circle(tmp_path: Path) -> None:
    exemption = {"importer": "house.cellar.*", "imported": "house.kitchen.stove", "reason": "heat"}
    modules = {"house.cellar.coal": "import house.kitchen.stove", "house.kitchen.stove": "import house.cellar.coal"}
    assert len(faults(tmp_path, modules)) == 2
    assert faults(tmp_path, modules, table(exemptions=[exemption])) == []


def test_an_exemption_that_nothing_needs_fails(tmp_path: Path) -> None:
    exemption = {"importer": "house.kitchen.stove", "imported": "house.cellar.coal", "reason": "none"}
    modules = {"house.kitchen.stove": "import house.cellar.coal", "house.cellar.coal": ""}
    (found,) = faults(tmp_path, modules, table(exemptions=[exemption]))
    assert "the exemption of house.kitchen.stove -> house.cellar.coal is no longer needed" in found


@pytest.mark.parametrize("text", ["max_modules_in_a_folder = ", "ros = []", "mood = 'good'"])
def test_a_table_that_cannot_be_read_is_an_error_with_its_path(tmp_path: Path, text: str) -> None:
    (tmp_path / "layers.toml").write_text(text)
    with pytest.raises(TableError, match="layers.toml: "):
        read_layer_table(tmp_path / "layers.toml")


def test_an_arrow_that_follows_from_others_is_left_out() -> None:
    edges = {("a", "b"), ("b", "c"), ("a", "c"), ("c", "d"), ("a", "d")}
    assert without_shortcuts(edges) == {("a", "b"), ("b", "c"), ("c", "d")}


def test_the_drawing_shows_rooms_and_packages_and_knows_when_it_is_out_of_date(tmp_path: Path) -> None:
    roof = "import house.cellar.coal, ground.stone"
    modules = {"house.roof.tiles": roof, "house.cellar.coal": "", "ground.stone": ""}
    text = dot_text(tree(tmp_path, modules), table())
    assert '"house/roof" -> "house/cellar";' in text
    assert 'ltail="cluster_house"' in text
    drawing = tmp_path / "architecture.svg"
    assert not is_up_to_date(text, drawing)
    draw(text, drawing)
    assert is_up_to_date(text, drawing)
    assert ">kitchen</text>" in drawing.read_text()
    modules["house.bedroom.bed"] = "import house.cellar.coal"
    assert not is_up_to_date(dot_text(tree(tmp_path, modules), table()), drawing)


@pytest.mark.parametrize("text", ["from fake_arm import Arm", "def run():\n    import fake_arm"])
@pytest.mark.parametrize("file", ["benchmarks/speed", "src/house/src/house/roof.py"])
def test_an_import_from_the_tests_fails_in_packages_and_benchmarks(tmp_path: Path, file: str, text: str) -> None:
    for name, content in (("tests/unit/fake_arm.py", ""), (file, f"#!/usr/bin/env python3\n{text}\n")):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text(content)
    assert python_files(tmp_path, [file]) == [file]
    (found,) = imports_of_tests(tmp_path, [file])
    assert found.startswith(f"{file}:{text.count(chr(10)) + 2}: imports tests/unit/fake_arm.py; allowed: ")


def test_imports_of_packages_and_of_modules_beside_the_file_pass(tmp_path: Path) -> None:
    for name in ("tests", "benchmarks"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "fault_table.py").touch()
    (tmp_path / "benchmarks" / "faults").write_text("import fault_table\nimport json\nfrom house.roof import tiles\n")
    assert not list(imports_of_tests(tmp_path, ["benchmarks/faults"]))


def test_no_packages_depend_on_each_other_in_a_circle() -> None:
    """Catkin builds such packages one at a time, and ends with an internal error if it builds all of them."""
    packages = find_packages(str(ROOT / "src")).values()
    graph = {package.name: {item.name for item in package.build_depends + package.exec_depends} for package in packages}
    assert len(tuple(TopologicalSorter(graph).static_order())) >= len(packages) > 1
