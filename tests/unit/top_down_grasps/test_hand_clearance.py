# SPDX-License-Identifier: BSD-3-Clause
"""No part of the hand but the pads touches what is grasped; distances are those of Coal, a library of its own."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from modular_framework_core.grasp_generation import surface_points
from modular_framework_core.grasp_generation.gripper_geometry import (
    GripperGeometry,
    GripperGeometryError,
    measure_gripper,
)
from modular_framework_core.grasp_generation.surface_points import Surface
from top_down_grasps.top_down import TopDownGrasp, TopDownSettings, top_down_grasps

sys.path.insert(0, str(Path(__file__).parents[1]))
from two_finger_hands import GRIPPERS, PARALLEL_JAWS, Hand, jaws  # noqa: E402

coal = pytest.importorskip("coal")
pinocchio = pytest.importorskip("pinocchio")

UP = np.array([0.0, 0.0, 1.0])
SAMPLING_M = 0.003  # points on a surface are up to 4 mm apart, and a round side of 24 corners is 0.1 mm too wide


@dataclass(frozen=True)
class Thing:
    """An object as points for the generator, and as a shape of Coal."""

    surface: Surface
    shape: Any
    pose: Any


def cylinder(diameter: float, height: float) -> Thing:
    place = np.array([0.1, 0.5, height / 2])
    return Thing(
        surface_points.cylinder(height, diameter / 2).transformed(np.eye(3), place),
        coal.Cylinder(diameter / 2, height),
        pinocchio.SE3(np.eye(3), place),
    )


def block(width: float, depth: float, height: float) -> Thing:
    turn, place = Rotation.from_euler("z", 0.4).as_matrix(), np.array([0.1, 0.5, height / 2])
    return Thing(
        surface_points.box((width, depth, height)).transformed(turn, place),
        coal.Box(width, depth, height),
        pinocchio.SE3(turn, place),
    )


def clearances(hand: Hand, grasp: TopDownGrasp, height: float, joint: float, thing: Thing) -> dict[str, float]:
    """Distance of each shape of the hand [m] from the object, the hand this far above the grasp."""
    x, y, z, w = grasp.quaternion_xyzw
    rotation = pinocchio.Quaternion(w, x, y, z).matrix()
    shapes = hand.shapes(np.array(grasp.position) + height * UP, rotation, joint)
    return {name: distance(shape, pose, thing) for name, (shape, pose) in shapes.items()}


def distance(shape: Any, pose: Any, thing: Thing) -> float:
    return float(
        coal.distance(
            shape,
            coal.Transform3s(pose.rotation, pose.translation),
            thing.shape,
            coal.Transform3s(thing.pose.rotation, thing.pose.translation),
            coal.DistanceRequest(),
            coal.DistanceResult(),
        )
    )


THINGS = {
    "can": cylinder(0.066, 0.115),
    "tube": cylinder(0.04, 0.14),
    "thick": cylinder(0.07, 0.16),
    "block": block(0.05, 0.06, 0.13),
    "cube": block(0.05, 0.05, 0.05),
}


@pytest.mark.parametrize("name", THINGS)
@pytest.mark.parametrize(("urdf", "joint", "frame"), GRIPPERS, ids=["ezgripper", "jaws"])
def test_nothing_but_the_pads_comes_near_the_object(urdf: Callable[[], str], joint: str, frame: str, name: str) -> None:
    thing, settings, text = THINGS[name], TopDownSettings(), urdf()
    gripper, hand = measure_gripper(text, frame, joint), Hand(text, joint, frame)
    grasps = top_down_grasps(thing.surface, 0.0, gripper, settings)
    assert grasps, f"no grasp of {name}"
    for grasp in grasps[:6]:
        for height in np.linspace(0.0, settings.approach_distance_m, 6):
            room = clearances(hand, grasp, float(height), grasp.pregrasp_joint, thing)
            assert min(room.values()) > settings.finger_clearance_m - SAMPLING_M, (name, grasp, height, room)
        touch = gripper.position_for(grasp.width + 0.001)
        for closing in np.linspace(grasp.pregrasp_joint, touch, 6):
            room = clearances(hand, grasp, 0.0, float(closing), thing)
            assert min(room.values()) > 0.0, (name, grasp, closing, room)


def test_a_mesh_counts_like_the_shape_it_draws(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.cylinder(0.05, 0.06, sections=24).export(tmp_path / "housing.stl")
    drawn = measure_gripper(
        PARALLEL_JAWS.format(housing=f'mesh filename="file://{tmp_path}/housing.stl"'), "tool", "slide"
    )
    named = measure_gripper(jaws(), "tool", "slide")
    thing = cylinder(0.04, 0.2)
    for mesh_grasp, grasp in zip(
        top_down_grasps(thing.surface, 0.0, drawn, TopDownSettings()),
        top_down_grasps(thing.surface, 0.0, named, TopDownSettings()),
        strict=True,
    ):
        assert mesh_grasp.position == pytest.approx(grasp.position, abs=1e-4)


@pytest.mark.parametrize(
    "housing",
    [
        "plane",
        'mesh filename="package://moon/housing.stl"',
        'box size="0.1 0 0.1"',
        'cylinder radius="nan" length="0.1"',
    ],
)
def test_a_shape_that_cannot_be_used_is_refused_with_its_link(housing: str) -> None:
    with pytest.raises(GripperGeometryError, match="collision shape of link 'housing'"):
        measure_gripper(PARALLEL_JAWS.format(housing=housing), "tool", "slide")


def test_a_hand_that_cannot_get_past_a_wide_top_is_not_sent_there() -> None:
    gripper: GripperGeometry = measure_gripper(jaws(), "tool", "slide")
    stem = surface_points.cylinder(0.10, 0.02).transformed(np.eye(3), np.array([0.0, 0.0, 0.05]))
    hat = surface_points.cylinder(0.02, 0.06).transformed(np.eye(3), np.array([0.0, 0.0, 0.11]))
    grasps = top_down_grasps(surface_points.join_surfaces([stem, hat]), 0.0, gripper, TopDownSettings())
    assert all(grasp.position[2] > 0.12 for grasp in grasps)
