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

from modular_framework_description.scene_writer import world_scene_text
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_world
from modular_framework_simulation.models.sdf_resources import Resources

TABLE_HEIGHT = 0.84
OBJECTS = ("wood_block", "can", "l_bracket")


@pytest.fixture(scope="module")
def world(package: Path) -> dict[str, specs.Model]:
    models = read_world(package / "worlds" / "ur5_setup.world", Resources((package / "models",))).models
    return {model.name: model for model in models}


def read_scene(text: str) -> dict[str, list[tuple[str, list[float], list[float], list[float]]]]:
    """Objects of a text scene in the layout without object poses: kind, size, position and quaternion of each shape."""
    lines = text.splitlines()
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


def matrix(pose: Pose) -> np.ndarray:
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_quat(pose.quaternion).as_matrix()
    transform[:3, 3] = pose.position
    return transform


def size_of(geometry: specs.Geometry) -> tuple[float, ...]:
    match geometry:
        case specs.Box():
            return geometry.size
        case specs.Cylinder():
            return geometry.radius, geometry.length
        case specs.Plane():
            return (*geometry.normal, 0.0)
    raise AssertionError(geometry)


def test_world_and_scene_hold_the_same_shapes_at_the_same_places(package: Path, world: dict[str, specs.Model]) -> None:
    scene = read_scene((package / "scenes" / "ur5_setup.scene").read_text())
    assert set(scene) == {f"{name}__link" for name in world}
    for name, model in world.items():
        (link,) = model.links
        for (kind, size, position, quaternion), shape in zip(scene[f"{name}__link"], link.collisions, strict=True):
            expected = matrix(model.pose) @ matrix(link.pose) @ matrix(shape.pose)
            assert kind == type(shape.geometry).__name__.lower()
            assert np.allclose(size, size_of(shape.geometry))
            assert np.allclose(position, expected[:3, 3], atol=1e-8)
            assert np.allclose(Rotation.from_quat(quaternion).as_matrix(), expected[:3, :3], atol=1e-8)


def test_the_committed_scene_is_what_the_tool_writes(package: Path) -> None:
    text = world_scene_text(package / "worlds" / "ur5_setup.world", package / "models")
    assert text == (package / "scenes" / "ur5_setup.scene").read_text()


def test_the_world_has_the_models_of_the_set_up(world: dict[str, specs.Model]) -> None:
    assert set(world) == {"ground_plane", "robot_pedestal", "table", *OBJECTS}


def test_the_surface_of_the_table_covers_the_workspace_at_its_height(world: dict[str, specs.Model]) -> None:
    table = world["table"]
    top = table.links[0].collisions[0]
    assert isinstance(top.geometry, specs.Box)
    centre = np.array((table.pose @ top.pose).position)
    lower, upper = (centre + sign * np.array(top.geometry.size) / 2 for sign in (-1, 1))
    assert upper[2] == pytest.approx(TABLE_HEIGHT)
    assert lower[0] <= -0.345 and upper[0] >= 0.355
    assert lower[1] <= 0.2 and upper[1] >= 0.9


def test_the_pedestal_carries_the_arm_without_touching_it(world: dict[str, specs.Model]) -> None:
    pedestal = world["robot_pedestal"]
    shape = pedestal.links[0].collisions[0]
    assert isinstance(shape.geometry, specs.Box)
    top = (pedestal.pose @ shape.pose).position[2] + shape.geometry.size[2] / 2
    assert 0.84 < top < 0.857 - 0.001


@pytest.mark.parametrize("name", OBJECTS)
def test_objects_stand_on_the_table(world: dict[str, specs.Model], name: str) -> None:
    heights = {"wood_block": 0.10, "can": 0.115, "l_bracket": 0.08}
    assert world[name].pose.position[2] - heights[name] / 2 == pytest.approx(TABLE_HEIGHT)


def test_objects_leave_room_for_the_open_gripper(world: dict[str, specs.Model]) -> None:
    places = [np.array(world[name].pose.position[:2]) for name in OBJECTS]
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
def test_the_arm_reaches_objects_from_above(world: dict[str, specs.Model], name: str, height: float) -> None:
    folder = rospkg.RosPack().get_path("ur5_ezgripper_robot")
    model = pinocchio.buildModelFromXML(expand(f"{folder}/urdf/ur5_with_ezgripper.urdf.xacro"), mimic=True)
    position = np.array(world[name].pose.position) + [0, 0, height]
    goal = pinocchio.SE3(pinocchio.rpy.rpyToMatrix(math.pi, 0, 0), position)
    assert any(solve_ik(model, goal, seed) for seed in range(20))


WORLD = '<sdf version="1.5"><world name="w">{}</world></sdf>'


def test_a_missing_model_is_named(tmp_path: Path, package: Path) -> None:
    path = tmp_path / "lost.world"
    path.write_text(WORLD.format("<include><uri>model://no_such_model</uri></include>"))
    with pytest.raises(DescriptionError, match=r"model://no_such_model.*models/no_such_model"):
        world_scene_text(path, package / "models")


def test_a_shape_a_scene_cannot_hold_is_refused(tmp_path: Path) -> None:
    (tmp_path / "part.stl").write_text("")
    path = tmp_path / "strange.world"
    path.write_text(
        WORLD.format(
            '<model name="m"><link name="l"><collision name="c"><geometry><mesh><uri>part.stl</uri></mesh>'
            "</geometry></collision></link></model>"
        )
    )
    with pytest.raises(DescriptionError, match="m__l: a collision shape is a mesh; allowed"):
        world_scene_text(path, tmp_path)


def test_poses_of_model_link_and_collision_are_chained(tmp_path: Path) -> None:
    path = tmp_path / "chained.world"
    path.write_text(
        WORLD.format(
            '<model name="m"><pose>1 0 0 0 0 1.5707963267948966</pose><link name="l"><pose>1 0 0 0 0 0</pose>'
            '<collision name="c"><pose>0 0 1 0 0 0</pose><geometry><sphere><radius>0.1</radius></sphere></geometry>'
            "</collision></link></model>"
        )
    )
    (shape,) = read_scene(world_scene_text(path, tmp_path))["m__l"]
    assert shape[:2] == ("sphere", [0.1])
    assert np.allclose(shape[2], [1, 1, 1])
