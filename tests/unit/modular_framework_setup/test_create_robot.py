# SPDX-License-Identifier: BSD-3-Clause
"""From a bare URDF come two packages without a fault, which plan at once."""

from __future__ import annotations

import builtins
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import fcl
import numpy as np
import pinocchio
import pybullet_data
import pytest
import roslaunch
import trimesh
import yaml
from xacro_rospkg import expand

from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_setup.checks.package_check import check_package
from modular_framework_setup.commands.create_command import main
from modular_framework_setup.config_files.config_package import find_package, packages_beside

PYPI = Path(pybullet_data.getDataPath())
BARE = {"panda": PYPI / "franka_panda" / "panda.urdf", "lbr_iiwa": PYPI / "kuka_iiwa" / "model.urdf"}
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def link(name: str, size: str = "", xyz: str = "0 0 0") -> str:
    shape = f'{INERTIAL}<collision><origin xyz="{xyz}"/><geometry><box size="{size}"/></geometry></collision>'
    return f'<link name="{name}">{shape if size else ""}</link>'


def joint(name: str, parent: str, child: str, xyz: str, axis: str = "0 1 0", kind: str = "revolute") -> str:
    limit = '<limit lower="-2" upper="2" effort="10" velocity="1"/>'
    if kind == "prismatic":
        limit = '<limit lower="0" upper="0.04" effort="10" velocity="0.1"/>'
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{"" if kind == "fixed" else limit}</joint>'


def arm(prefix: str, base: str, xyz: str) -> str:
    """Three joints and a gripper whose two fingers are not said to move together."""
    return "".join(
        (
            link(f"{prefix}turret", "0.1 0.1 0.1", "0 0 0.05"),
            link(f"{prefix}boom", "0.05 0.05 0.3", "0 0 0.2"),
            link(f"{prefix}stick", "0.05 0.05 0.3", "0 0 0.2"),
            link(f"{prefix}palm", "0.05 0.1 0.04", "0 0 0.02"),
            link(f"{prefix}finger_a", "0.02 0.01 0.08", "0 0.005 0.04"),
            link(f"{prefix}finger_b", "0.02 0.01 0.08", "0 -0.005 0.04"),
            joint(f"{prefix}pan", base, f"{prefix}turret", xyz, "0 0 1"),
            joint(f"{prefix}lift", f"{prefix}turret", f"{prefix}boom", "0 0 0.11"),
            joint(f"{prefix}elbow", f"{prefix}boom", f"{prefix}stick", "0 0 0.36"),
            joint(f"{prefix}hand", f"{prefix}stick", f"{prefix}palm", "0 0 0.36", kind="fixed"),
            joint(f"{prefix}slide_a", f"{prefix}palm", f"{prefix}finger_a", "0 0 0.041", kind="prismatic"),
            joint(f"{prefix}slide_b", f"{prefix}palm", f"{prefix}finger_b", "0 0 0.041", "0 -1 0", "prismatic"),
        )
    )


CRANE = f'<robot name="Crane-1">{link("base", "0.2 0.2 0.1", "0 0 -0.05")}{arm("", "base", "0 0 0.01")}</robot>'


def four_bar_crane() -> str:
    """The crane with a hand whose fingers hang on the palm by two knuckles each; a pad stays upright on each."""
    head, tail = CRANE.split(link("finger_a", "0.02 0.01 0.08", "0 0.005 0.04"))
    tail = tail[tail.index('<joint name="pan"') : tail.index('<joint name="slide_a"')]
    parts = [head, tail]
    for side, name in ((1, "left"), (-1, "right")):
        for knuckle, place, length in (("outer", 0.03, 0.05), ("inner", 0.013, 0.04)):
            parts.append(link(f"{name}_{knuckle}", f"0.02 0.008 {length}", f"0 {side * 0.03} {length / 2}"))
            turn = joint(f"{name}_{knuckle}_j", "palm", f"{name}_{knuckle}", f"0 {side * place} 0.05", f"{side} 0 0")
            turn = turn.replace('lower="-2" upper="2"', 'lower="0" upper="0.8"')
            parts.append(turn if (name, knuckle) == ("left", "outer") else following(turn, 1.0))
        parts.append(link(f"{name}_pad", "0.022 0.006 0.038", "0 0 0.02"))
        pad = joint(f"{name}_pad_j", f"{name}_outer", f"{name}_pad", f"0 {side * 0.03} 0.05", f"{side} 0 0")
        parts.append(following(pad, -1.0))
    return "".join((*parts, "</robot>"))


def following(turn: str, multiplier: float) -> str:
    return turn.replace("</joint>", f'<mimic joint="left_outer_j" multiplier="{multiplier}"/></joint>')


TWINS = (
    f'<robot name="twins">{link("base", "0.2 0.2 0.1")}{link("chest", "0.2 0.2 0.2", "0 0 0.2")}'
    f"{joint('waist', 'base', 'chest', '0 0 0', '0 0 1')}"
    f"{arm('left_', 'chest', '0 0.4 0.4')}{arm('right_', 'chest', '0 -0.4 0.4')}</robot>"
)


@dataclass(frozen=True)
class Made:
    """The packages of a robot."""

    name: str
    into: Path

    @property
    def config(self) -> Path:
        return self.into / f"{self.name}_moveit_config"

    def text(self) -> str:
        """The description, with meshes by their paths."""
        text = expand(self.into / f"{self.name}_robot/urdf/{self.name}.urdf.xacro")
        return text.replace("package://", f"{self.into}/")

    def srdf(self) -> ElementTree.Element:
        return ElementTree.parse(self.config / f"config/{self.name}.srdf").getroot()

    def states(self) -> dict[str, dict[str, float]]:
        return {
            f"{state.get('group')} {state.get('name')}": {
                item.get("name", ""): float(item.get("value", "")) for item in state
            }
            for state in self.srdf().findall("group_state")
        }


def make(name: str, into: Path, *options: str) -> Made:
    assert main([*options, "--into", str(into), "--yes"]) == 0
    return Made(name, into)


def write(folder: Path, text: str) -> str:
    path = folder / "bare.urdf"
    path.write_text(text)
    return str(path)


@pytest.fixture
def package_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for packages that ROS finds."""
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path}{os.pathsep}{os.environ['ROS_PACKAGE_PATH']}")
    return tmp_path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The packages of robots as PyPI has them."""
    path = tmp_path_factory.mktemp("robots")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_PACKAGE_PATH", f"{path}{os.pathsep}{os.environ['ROS_PACKAGE_PATH']}")
        for name, urdf in BARE.items():
            make(name, path, str(urdf), "--samples", "250")
        yield path


@pytest.fixture(params=BARE)
def bare(request: pytest.FixtureRequest, folder: Path) -> Made:
    """One of them."""
    return Made(request.param, folder)


def test_a_bare_urdf_makes_packages_without_a_fault(bare: Made) -> None:
    assert check_package(bare.config) == ()
    arm_group = bare.srdf().find("group[@name='arm']/chain")
    assert arm_group is not None
    assert len(yaml.safe_load((bare.config / "config/joint_limits.yaml").read_text())["joint_limits"]) in (7, 8)


@pytest.mark.parametrize(("effort", "written"), [("1000", 100.0), ("60", 60.0)])
def test_an_effort_that_would_crush_every_object_is_replaced_with_a_note(
    package_path: Path, capsys: pytest.CaptureFixture[str], effort: str, written: float
) -> None:
    """The fingers of the crane slide: their effort is their force [N]."""
    text = CRANE.replace('upper="0.04" effort="10"', f'upper="0.04" effort="{effort}"')
    made = make("crane_1", package_path, write(package_path, text), "--samples", "100")
    limits = [
        item.find("limit") for item in ElementTree.fromstring(made.text()).iter("joint") if item.find("mimic") is None
    ]
    (slide,) = (item for item in limits if item is not None and item.get("upper") == "0.04")
    assert float(slide.get("effort", "nan")) == pytest.approx(written)
    assert ("has the effort 1000, which corresponds to a finger force of 1000 N" in capsys.readouterr().out) == (
        effort == "1000"
    )


def test_its_matrix_keeps_every_pair_that_can_collide(bare: Made) -> None:
    """Bodies are read by trimesh and checked by FCL, at states that the command did not see."""
    reasons = {
        frozenset((item.get("link1"), item.get("link2"))): item.get("reason")
        for item in bare.srdf().findall("disable_collisions")
    }
    model = pinocchio.buildModelFromXML(bare.text(), mimic=True)
    bodies = dict(collision_meshes(bare.text()))
    data, random = model.createData(), np.random.default_rng(20)
    lower, upper = (np.clip(limit, -np.pi, np.pi) for limit in (model.lowerPositionLimit, model.upperPositionLimit))
    colliding = set()
    for state in random.uniform(lower, upper, size=(600, len(lower))):
        pinocchio.framesForwardKinematics(model, data, state)
        for name, body in bodies.items():
            pose = data.oMf[model.getFrameId(name)]
            body.setTransform(fcl.Transform(pose.rotation, pose.translation))
        for one, other in combinations(bodies, 2):
            if fcl.collide(bodies[one], bodies[other], fcl.CollisionRequest(), fcl.CollisionResult()):
                colliding.add(frozenset((one, other)))
    assert [pair for pair in colliding if reasons.get(pair) == "Never"] == []
    assert [pair for pair in colliding if pair not in reasons], "no pair that is checked ever collides"


def collision_meshes(urdf: str) -> Iterator[tuple[str, fcl.CollisionObject]]:
    """Yields the body of each link that has one, in the link's frame."""
    for element in ElementTree.fromstring(urdf).findall("link"):
        parts = []
        for item in element.findall("collision"):
            mesh = trimesh.load(item.find("geometry/mesh").get("filename"), force="mesh", process=False)  # type: ignore[union-attr]
            origin = item.find("origin")
            xyz, rpy = (
                [float(word) for word in (origin.get(key, "0 0 0") if origin is not None else "0 0 0").split()]
                for key in ("xyz", "rpy")
            )
            mesh.apply_transform(trimesh.transformations.compose_matrix(angles=rpy, translate=xyz))
            parts.append(mesh)
        if parts:
            body, whole = fcl.BVHModel(), trimesh.util.concatenate(parts)
            body.beginModel(len(whole.vertices), len(whole.faces))
            body.addSubModel(whole.vertices, whole.faces)
            body.endModel()
            yield element.get("name", ""), fcl.CollisionObject(body)


def test_it_can_be_launched(bare: Made) -> None:
    loaded = roslaunch.config.load_config_default([str(bare.config / "launch/demo.launch")], None, verbose=False)
    assert {node.type for node in loaded.nodes} >= {
        "move_group",
        "robot_state_publisher",
        "joint_state_publisher",
        "rviz",
    }
    assert loaded.params["/robot_description_semantic"].value.count("<group name=") == len(bare.srdf().findall("group"))


def test_the_planner_loads_it_and_the_ready_state_points_down(bare: Made) -> None:
    srdf = (bare.config / f"config/{bare.name}.srdf").read_text()
    model = RobotModel(bare.text(), srdf)
    state = model.merge(model.default_positions(), bare.states()["arm ready"])
    assert model.bound_violations(state, range(len(state))) == []
    pose = model.link_transforms(state)[model.group("arm").tip_link]
    assert pose.rotation[2, 2] < -0.9
    assert pose.translation[0] > 0.3
    assert abs(pose.translation[1]) < 0.1


def test_a_gripper_gets_a_grasp_frame_and_its_second_finger_follows_the_first(package_path: Path) -> None:
    made = make("crane_1", package_path, write(package_path, CRANE), "--samples", "100")
    assert check_package(made.config) == ()
    chain = made.srdf().find("group[@name='arm']/chain")
    assert chain is not None
    assert (chain.get("base_link"), chain.get("tip_link")) == ("base", "gripper_grasp_frame")
    assert made.states()["gripper open"] == {"slide_a": 0.04}
    assert made.states()["gripper closed"]["slide_a"] == pytest.approx(0.0, abs=6e-4)
    robot = ElementTree.fromstring(made.text())
    mimic = robot.find("joint[@name='slide_b']/mimic")
    assert mimic is not None
    assert mimic.get("joint") == "slide_a"
    driven = [item.get("name") for item in robot.findall("transmission/joint")]
    assert driven == ["pan", "lift", "elbow", "slide_a"]
    origin = robot.find("joint[@name='gripper_grasp_frame_joint']/origin")
    assert origin is not None
    x, y, z = map(float, origin.get("xyz", "").split())
    assert (x, y) == pytest.approx((0.0, 0.0), abs=2e-3)
    assert 0.08 < z < 0.12  # the fingers reach from 0.041 to 0.121
    pair = made.srdf().find("disable_collisions[@link1='finger_a'][@link2='finger_b']")
    assert pair is not None
    assert pair.get("reason") == "Default"


def test_fingers_with_equal_axes_and_opposite_limits_are_a_gripper(package_path: Path) -> None:
    second = joint("slide_b", "palm", "finger_b", "0 0 0.041", "0 -1 0", "prismatic")
    opposite = second.replace("0 -1 0", "0 1 0").replace('lower="0" upper="0.04"', 'lower="-0.04" upper="0"')
    made = make("crane_1", package_path, write(package_path, CRANE.replace(second, opposite)), "--samples", "100")
    mimic = ElementTree.fromstring(made.text()).find("joint[@name='slide_b']/mimic")
    assert mimic is not None and mimic.attrib == {"joint": "slide_a", "multiplier": "-1"}
    assert made.states()["gripper open"] == {"slide_a": 0.04}


@pytest.mark.parametrize(("axis", "opened"), [("0 1 0", 0.04), ("0 -1 0", -0.04)], ids=["along", "against"])
def test_a_jaw_opens_away_from_a_fixed_jaw_and_the_grasp_frame_is_between_them(
    axis: str, opened: float, package_path: Path
) -> None:
    slide_a = joint("slide_a", "palm", "finger_a", "0 0 0.041", kind="prismatic")
    slide_b = joint("slide_b", "palm", "finger_b", "0 0 0.041", "0 -1 0", "prismatic")
    moving = slide_a.replace("0 1 0", axis)
    if opened < 0.0:
        moving = moving.replace('lower="0" upper="0.04"', 'lower="-0.04" upper="0"')
    text = CRANE.replace(slide_a, moving).replace(slide_b, joint("b", "palm", "finger_b", "0 0 0.041", kind="fixed"))
    made = make("crane_1", package_path, write(package_path, text), "--gripper", "finger_a", "--samples", "100")
    assert check_package(made.config) == ()
    states = made.states()
    assert states["gripper open"] == {"slide_a": opened}
    assert states["gripper closed"]["slide_a"] == pytest.approx(0.0, abs=6e-4)
    origin = ElementTree.fromstring(made.text()).find("joint[@name='gripper_grasp_frame_joint']/origin")
    assert origin is not None
    middle = (0.04 + 0.005 - 0.005) / 2
    assert list(map(float, origin.get("xyz", "").split()))[:2] == pytest.approx([0.0, middle], abs=1e-3)
    turn = pinocchio.rpy.rpyToMatrix(*map(float, origin.get("rpy", "").split()))
    assert abs(turn[:, 0]) == pytest.approx([0.0, 1.0, 0.0], abs=1e-4)
    pair = made.srdf().find("disable_collisions[@link1='finger_a'][@link2='finger_b']")
    assert pair is not None and pair.get("reason") == "Default"


def test_the_grasp_frame_of_fingers_on_two_links_each_is_straight_and_in_the_middle(package_path: Path) -> None:
    made = make("crane_1", package_path, write(package_path, four_bar_crane()), "--samples", "100")
    origin = ElementTree.fromstring(made.text()).find("joint[@name='gripper_grasp_frame_joint']/origin")
    assert origin is not None
    turn = pinocchio.rpy.rpyToMatrix(*map(float, origin.get("rpy", "").split()))
    assert abs(turn[:, 0]) == pytest.approx([0.0, 1.0, 0.0], abs=1e-4), "the fingers close along y of the palm"
    assert turn[:, 2] == pytest.approx([0.0, 0.0, 1.0], abs=1e-4), "they stand out along z"
    assert list(map(float, origin.get("xyz", "").split()))[:2] == pytest.approx([0.0, 0.0], abs=1e-4)


def test_two_arms_on_a_torso_get_groups_of_their_own(package_path: Path) -> None:
    made = make("twins", package_path, write(package_path, TWINS), "--samples", "100")
    assert check_package(made.config) == ()
    groups = [item.get("name") for item in made.srdf().findall("group")]
    assert groups == ["left_arm", "right_arm", "torso", "all_arms", "left_gripper", "right_gripper"]
    controllers = yaml.safe_load((made.config / "config/moveit_controllers.yaml").read_text())["controller_list"]
    assert [len(item["joints"]) for item in controllers] == [3, 3, 1, 1, 1]
    assert len(made.srdf().findall("end_effector")) == 2


def test_options_name_the_arm_and_the_fingers(package_path: Path) -> None:
    source = write(package_path, CRANE)
    options = ("--name", "boom", "--arm", "turret", "stick", "--gripper", "finger_a", "finger_b", "--samples", "50")
    made = make("boom", package_path, source, *options)
    chain = made.srdf().find("group[@name='arm']/chain")
    assert chain is not None
    assert dict(chain.attrib) == {"base_link": "turret", "tip_link": "stick"}


def test_the_same_seed_makes_the_same_package(package_path: Path) -> None:
    source = write(package_path, CRANE)
    for name in ("one", "two"):
        make("crane", package_path / name, source, "--name", "crane", "--samples", "60", "--seed", "7")
    texts = [(package_path / name / "crane_moveit_config/config/crane.srdf").read_text() for name in ("one", "two")]
    assert texts[0] == texts[1]


@pytest.mark.parametrize("is_on_path", [True, False])
def test_the_last_lines_start_the_packages(
    is_on_path: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if is_on_path:
        monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path}{os.pathsep}{os.environ['ROS_PACKAGE_PATH']}")
    make("crane_1", tmp_path / "new", write(tmp_path, CRANE), "--samples", "20")
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "    roslaunch crane_1_moveit_config demo.launch"
    assert (f"    export ROS_PACKAGE_PATH={tmp_path / 'new'}:$ROS_PACKAGE_PATH" in lines) is not is_on_path


def test_nothing_is_overwritten(package_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write(package_path, CRANE)
    (package_path / "crane_1_robot").mkdir()
    assert main([source, "--into", str(package_path), "--yes"]) == 1
    assert "will not be overwritten" in capsys.readouterr().err
    assert list((package_path / "crane_1_robot").iterdir()) == []


@pytest.mark.parametrize(
    ("text", "options", "says"),
    [
        (CRANE, ("--arm", "base", "plam"), "link 'plam' is not in the URDF"),
        (CRANE, ("--arm", "palm", "base"), "'base' must be a descendant of 'palm'"),
        (CRANE, ("--gripper", "turet"), "did you mean 'turret'?"),
        (CRANE, ("--name", "My Robot"), "allowed: lower-case letters"),
        (CRANE, ("--samples", "0"), "allowed: 1 or more"),
        (CRANE, ("speed",), "NAME:=VALUE"),
        (CRANE.replace("<box size=", '<mesh filename="a/b.stl" size='), (), "mesh files are not found: a/b.stl"),
        ('<robot name="r"><link name="a"/></robot>', (), "no arm is found"),
        (CRANE.replace('lower="-2"', 'lower="low"'), (), "expected a number"),
        (
            CRANE.replace("</robot>", '<link name="alone"/></robot>'),
            (),
            "2 links have no parent joint (base, alone)",
        ),
        (CRANE.replace('<parent link="boom"', '<parent link="bom"'), (), "link 'bom' is unknown; allowed: base, "),
        (CRANE.replace('<parent link="turret"', '<parent link="palm"'), (), "closes a loop of links: "),
        (CRANE.replace('<parent link="base"', '<parent link="palm"'), (), "closes a loop of links: "),
        (CRANE.replace('<axis xyz="0 0 1"', '<axis xyz="0 0 0"'), (), "joint 'pan': its axis is 0 0 0; give it a"),
        ("<robot>", (), "not an XML document"),
    ],
)
def test_what_cannot_be_made_is_said(
    text: str, options: tuple[str, ...], says: str, package_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([write(package_path, text), *options, "--into", str(package_path), "--yes"]) == 1
    assert says in capsys.readouterr().err
    assert list(package_path.glob("*_moveit_config")) == []


def test_on_a_terminal_it_asks(package_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter(["asked", "", "turret", "turret stick", "", "turret stick"])
    asked: list[str] = []

    def answer(question: str) -> str:
        asked.append(question)
        return next(answers)

    monkeypatch.setattr(builtins, "input", answer)
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    assert main([write(package_path, CRANE), "--into", str(package_path), "--samples", "50"]) == 0
    assert "[crane_1]" in asked[0]
    assert "[finger_a finger_b]" in asked[1]
    chain = Made("asked", package_path).srdf().find("group[@name='arm']/chain")
    assert chain is not None
    assert chain.get("tip_link") == "stick"


def test_packages_are_looked_for_around_the_urdf_and_not_in_all_folders_beside_it(tmp_path: Path) -> None:
    """A URDF in the home folder must not have all home folders searched."""
    places = {"crane": "lab/crane", "meshes": "lab/meshes", "tools": "lab/stack/tools", "far": "lab/a/b/far"}
    for name, place in places.items():
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "package.xml").write_text(f"<package><name>{name}</name></package>")
    urdf_folder = tmp_path / "lab" / "crane" / "urdf"
    urdf_folder.mkdir()
    with packages_beside(urdf_folder):
        for name in ("crane", "meshes", "tools"):
            assert Path(find_package(name)) == tmp_path / places[name]
        with pytest.raises(KeyError):
            find_package("far")
    with pytest.raises(KeyError):
        find_package("meshes")
