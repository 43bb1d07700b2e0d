# SPDX-License-Identifier: BSD-3-Clause
"""World and scene describe the same set-up, and the arm reaches what stands on the table."""

import math
from pathlib import Path

import numpy as np
import pinocchio
import pytest
import rospkg
from scipy.spatial.transform import Rotation
from xacro_rospkg import expand

from modular_framework_description.scene_writer import scene_text
from modular_framework_description.sdf_world import PlacedLink, WorldError, read_world

TABLE_HEIGHT = 0.84
OBJECTS = ("wood_block", "can", "l_bracket")


@pytest.fixture(scope="module")
def world(package: Path) -> dict[str, PlacedLink]:
    links = read_world(package / "worlds" / "ur5_setup.world", package / "models")
    return {link.object_id: link for link in links}


def read_scene(path: Path) -> dict[str, list[tuple[str, list[float], list[float], list[float]]]]:
    """Objects of a text scene in the layout without object poses: kind, size, position and quaternion of each shape."""
    lines = path.read_text().splitlines()
    assert lines[-1] == "."
    objects: dict[str, list[tuple[str, list[float], list[float], list[float]]]] = {}
    row = 1
    while lines[row] != ".":
        shapes = objects[lines[row].removeprefix("* ")] = []
        for index in range(int(lines[row + 1])):
            kind, *rest = lines[row + 2 + 5 * index : row + 7 + 5 * index]
            size, position, quaternion, colour = ([float(value) for value in text.split()] for text in rest)
            assert len(colour) == 4
            shapes.append((kind, size, position, quaternion))
        row += 2 + 5 * len(shapes)
    return objects


def test_world_and_scene_hold_the_same_shapes_at_the_same_places(package: Path, world: dict[str, PlacedLink]) -> None:
    scene = read_scene(package / "scenes" / "ur5_setup.scene")
    assert set(scene) == set(world)
    for name, link in world.items():
        for (kind, size, position, quaternion), shape in zip(scene[name], link.shapes, strict=True):
            assert kind == shape.kind
            assert np.allclose(size[:3], shape.size)
            assert np.allclose(position, shape.pose[:3, 3], atol=1e-8)
            assert np.allclose(Rotation.from_quat(quaternion).as_matrix(), shape.pose[:3, :3], atol=1e-8)


def test_the_committed_scene_is_what_the_tool_writes(package: Path, world: dict[str, PlacedLink]) -> None:
    assert scene_text("ur5_setup", world.values()) == (package / "scenes" / "ur5_setup.scene").read_text()


def test_object_names_are_those_the_simulation_gives(world: dict[str, PlacedLink]) -> None:
    assert set(world) == {f"{name}__link" for name in ("ground_plane", "robot_pedestal", "table", *OBJECTS)}


def test_the_surface_of_the_table_covers_the_workspace_at_its_height(world: dict[str, PlacedLink]) -> None:
    top = world["table__link"].shapes[0]
    lower, upper = (top.pose[:3, 3] + sign * np.array(top.size) / 2 for sign in (-1, 1))
    assert upper[2] == pytest.approx(TABLE_HEIGHT)
    assert lower[0] <= -0.345 and upper[0] >= 0.355
    assert lower[1] <= 0.2 and upper[1] >= 0.9


def test_the_pedestal_carries_the_arm_without_touching_it(world: dict[str, PlacedLink]) -> None:
    pedestal = world["robot_pedestal__link"].shapes[0]
    top = pedestal.pose[2, 3] + pedestal.size[2] / 2
    assert 0.84 < top < 0.857 - 0.001


@pytest.mark.parametrize("name", OBJECTS)
def test_objects_stand_on_the_table(world: dict[str, PlacedLink], name: str) -> None:
    heights = {"wood_block": 0.10, "can": 0.115, "l_bracket": 0.08}
    assert world[f"{name}__link"].pose[2, 3] - heights[name] / 2 == pytest.approx(TABLE_HEIGHT)


def test_objects_leave_room_for_the_open_gripper(world: dict[str, PlacedLink]) -> None:
    places = [world[f"{name}__link"].pose[:2, 3] for name in OBJECTS]
    gaps = [np.linalg.norm(a - b) for index, a in enumerate(places) for b in places[:index]]
    assert min(gaps) > 0.2


def solve_ik(model: pinocchio.Model, goal: pinocchio.SE3, seed: int) -> bool:
    """Damped least squares from one random state; whether it arrived within 1 mm and 0.01 rad."""
    data, frame = model.createData(), model.getFrameId("eg_manipulator")
    state = np.append(np.random.default_rng(seed).uniform(-2.5, 2.5, 6), 1.0)
    for _ in range(200):
        pinocchio.framesForwardKinematics(model, data, state)
        error = pinocchio.log6(data.oMf[frame].actInv(goal)).vector
        if np.linalg.norm(error[:3]) < 1e-3 and np.linalg.norm(error[3:]) < 1e-2:
            return True
        jacobian = pinocchio.computeFrameJacobian(model, data, state, frame)[:, :6]
        state[:6] += jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-4 * np.eye(6), error)
    return False


@pytest.mark.parametrize("height", [0.0, 0.15])
@pytest.mark.parametrize("name", OBJECTS)
def test_the_arm_reaches_objects_from_above(world: dict[str, PlacedLink], name: str, height: float) -> None:
    folder = rospkg.RosPack().get_path("ur5_ezgripper_robot")
    model = pinocchio.buildModelFromXML(expand(f"{folder}/urdf/ur5_with_ezgripper.urdf.xacro"), mimic=True)
    position = world[f"{name}__link"].pose[:3, 3] + [0, 0, height]
    goal = pinocchio.SE3(pinocchio.rpy.rpyToMatrix(math.pi, 0, 0), position)
    assert any(solve_ik(model, goal, seed) for seed in range(20))


WORLD = '<sdf version="1.5"><world name="w">{}</world></sdf>'


def test_a_missing_model_is_named_with_those_there_are(tmp_path: Path, package: Path) -> None:
    path = tmp_path / "lost.world"
    path.write_text(WORLD.format("<include><uri>model://no_such_model</uri></include>"))
    with pytest.raises(WorldError, match=r"model://no_such_model.*'cube'"):
        read_world(path, package / "models")


def test_a_shape_a_scene_cannot_hold_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "strange.world"
    path.write_text(
        WORLD.format(
            '<model name="m"><link name="l"><collision name="c"><geometry><heightmap/>'
            "</geometry></collision></link></model>"
        )
    )
    with pytest.raises(WorldError, match="heightmap; allowed"):
        read_world(path, tmp_path)


def test_a_pose_with_five_numbers_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "short.world"
    path.write_text(WORLD.format('<model name="m"><pose>0 0 0 0 0</pose></model>'))
    with pytest.raises(WorldError, match="5 numbers; it must have 6"):
        read_world(path, tmp_path)


def test_poses_of_model_link_and_collision_are_chained(tmp_path: Path) -> None:
    path = tmp_path / "chained.world"
    path.write_text(
        WORLD.format(
            '<model name="m"><pose>1 0 0 0 0 1.5707963267948966</pose><link name="l"><pose>1 0 0 0 0 0</pose>'
            '<collision name="c"><pose>0 0 1 0 0 0</pose><geometry><sphere><radius>0.1</radius></sphere></geometry>'
            "</collision></link></model>"
        )
    )
    link = read_world(path, tmp_path)[0]
    assert np.allclose(link.pose[:3, 3], [1, 1, 0])
    assert np.allclose(link.shapes[0].pose[:3, 3], [1, 1, 1])
