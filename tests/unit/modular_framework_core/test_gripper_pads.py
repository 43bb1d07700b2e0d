# SPDX-License-Identifier: BSD-3-Clause
"""The pads of a gripper are the parts that bound the gap over the whole stroke, whatever the fingers are made of.

The hands are made of boxes. Their true openings are Coal's distances between the pads, placed by Pinocchio.
"""

from __future__ import annotations

import sys
from pathlib import Path

import coal
import numpy as np
import pinocchio
import pytest
import trimesh
from scipy.spatial import HalfspaceIntersection

from modular_framework_core.grasp_generation.convex_bodies import MESH_TOLERANCE_M, convex_hull
from modular_framework_core.grasp_generation.gripper_geometry import (
    GripperGeometry,
    GripperGeometryError,
    driven_joint,
    measure_gripper,
)

sys.path.insert(0, str(Path(__file__).parents[1]))
import two_finger_hands  # noqa: E402
from linkage_hands import four_bar_hand, joint, limit, link, mimic  # noqa: E402

TOLERANCE_M = 1.0e-3


def jaws(second: str, axis: str = "0 -1 0") -> str:
    """A hand of two jaws on a rail; the second joint has a mimic tag, limits of its own, or the limits of the first."""
    return f"""<robot name="jaws">{link("palm", 0.06, 0.14, 0.04)}
{link("left_pad", 0.02, 0.012, 0.05, z=0.05)}{link("right_pad", 0.02, 0.012, 0.05, z=0.05)}
{joint("drive", "prismatic", "palm", "left_pad", "0 0.006 0", "0 1 0", limit(0.05))}
{joint("other", "prismatic", "palm", "right_pad", "0 -0.006 0", axis, second)}</robot>"""


def fixed_jaw(pivot: str = "") -> str:
    """A hand of a jaw on the palm, and of a jaw that slides, or turns about an axis in the palm."""
    kind, axis, motion = ("revolute", pivot, limit(0.4)) if pivot else ("prismatic", "0 1 0", limit(0.05))
    return f"""<robot name="vise">{link("palm", 0.06, 0.14, 0.04)}
{link("left_pad", 0.02, 0.012, 0.05, z=0.05)}{link("right_pad", 0.03, 0.02, 0.09, z=0.065)}
{joint("drive", kind, "palm", "left_pad", "0 0.006 0", axis, motion)}
{joint("mount", "fixed", "palm", "right_pad", "0 -0.01 0")}</robot>"""


def turning_hand() -> str:
    """A hand of two turning fingers with tips that stay upright, one of which carries a frame without a shape (PR2)."""
    parts = [link("palm", 0.06, 0.1, 0.05)]
    for side, name in ((1, "left"), (-1, "right")):
        drive = limit(0.5) if side > 0 else mimic("drive", -1.0)
        parts += [
            link(f"{name}_finger", 0.02, 0.012, 0.09, z=0.045),
            joint("drive" if side > 0 else "other", "revolute", "palm", f"{name}_finger", f"0 {side * 0.012} 0.03",
                  "-1 0 0", drive),
            link(f"{name}_pad", 0.02, 0.012, 0.04, z=0.02),
            joint(f"{name}_tip", "revolute", f"{name}_finger", f"{name}_pad", f"0 {side * -0.006} 0.09", "1 0 0",
                  mimic("drive", side)),
        ]  # fmt: skip
    parts += [link("tip_frame"), joint("tip", "fixed", "left_pad", "tip_frame", "0 0 0.04")]
    return f'<robot name="turning">{"".join(parts)}</robot>'


def true_openings(urdf: str, gripper: GripperGeometry) -> np.ndarray:
    """Distances between the pads by Pinocchio and Coal, at the sampled positions."""
    model = pinocchio.buildModelFromXML(urdf, mimic=True)
    shapes = pinocchio.buildGeomFromUrdfString(model, urdf, pinocchio.GeometryType.COLLISION)
    data, placed = model.createData(), shapes.createData()
    numbers = [
        next(index for index, shape in enumerate(shapes.geometryObjects) if shape.name.startswith(name))
        for name in ("left_pad", "right_pad")
    ]
    distances = []
    for position in gripper.positions:
        values = np.full(model.nq, position)  # jaws without a mimic tag move together
        values = np.where(model.upperPositionLimit <= 0.0, -position, values)
        pinocchio.updateGeometryPlacements(model, data, shapes, placed, values)
        ends = []
        for number in numbers:
            pose = placed.oMg[number]
            ends += [shapes.geometryObjects[number].geometry, coal.Transform3s(pose.rotation, pose.translation)]
        distances.append(coal.distance(*ends, coal.DistanceRequest(), coal.DistanceResult()))
    return np.maximum(np.array(distances), 0.0)


@pytest.mark.parametrize(
    ("urdf", "opening"),
    [
        (four_bar_hand(), 0.0859),
        (jaws(mimic("drive", 1.0)), 0.1),
        (jaws(limit(0.05)), 0.1),
        (jaws('<limit lower="-0.05" upper="0" effort="10" velocity="2"/>', "0 1 0"), 0.1),
        (turning_hand(), None),
        (jaws(mimic("drive", 0.3)), 0.065),
        (fixed_jaw(), 0.05),
        (fixed_jaw("-1 0 0"), None),
    ],
    ids=[
        "four-bar fingers",
        "jaws with a mimic tag",
        "jaws without one",
        "jaws with opposite limits",
        "turning fingers",
        "unequal strokes",
        "a fixed jaw",
        "a jaw that turns towards a fixed one",
    ],
)
def test_the_opening_is_the_distance_of_the_pads_over_the_whole_stroke(urdf: str, opening: float | None) -> None:
    gripper = measure_gripper(urdf, "palm", "drive")
    assert {part.link for part in gripper.parts if part.is_pad} == {"left_pad", "right_pad"}
    assert gripper.openings == pytest.approx(true_openings(urdf, gripper), abs=TOLERANCE_M)
    assert opening is None or gripper.max_opening == pytest.approx(opening, abs=TOLERANCE_M)
    assert abs(gripper.axes[:, 0]) == pytest.approx([0.0, 1.0, 0.0]) and gripper.axes[:, 2] == pytest.approx([0, 0, 1])


def test_a_chain_of_mimic_joints_moves_like_the_same_relations_to_the_driven_joint() -> None:
    before, after = four_bar_hand().split('<joint name="right_i"')
    chain = before + '<joint name="right_i"' + after.replace('mimic joint="drive"', 'mimic joint="right_drive"', 1)
    assert chain != four_bar_hand()
    gripper = measure_gripper(chain, "palm", "drive")
    assert gripper.openings == pytest.approx(true_openings(four_bar_hand(), gripper), abs=TOLERANCE_M)
    assert gripper.max_opening == pytest.approx(0.0859, abs=TOLERANCE_M)


@pytest.mark.parametrize("second", [mimic("drive", 1.0), limit(0.05)], ids=["mimic tag", "none"])
def test_the_length_of_an_axis_has_no_influence_on_the_stroke(second: str) -> None:
    urdf = jaws(second, "0 -3 0").replace('xyz="0 1 0"', 'xyz="0 2 0"')
    assert measure_gripper(urdf, "palm", "drive").max_opening == pytest.approx(0.1, abs=TOLERANCE_M)


def test_mimic_joints_in_a_circle_are_refused() -> None:
    urdf = jaws(mimic("other", 1.0))
    with pytest.raises(GripperGeometryError, match="'other': it mimics itself through other -> other"):
        measure_gripper(urdf, "palm", "drive")


def test_the_fingertips_of_a_four_bar_hand_are_in_front_of_the_pads() -> None:
    gripper = measure_gripper(four_bar_hand(), "palm", "drive")
    assert (gripper.tips >= gripper.pad_centres[:, 2] + gripper.pad_half_height - TOLERANCE_M).all()
    assert gripper.pad_half_width == pytest.approx(0.011) and gripper.pad_half_height == pytest.approx(
        0.01875, abs=1e-3
    )


@pytest.mark.parametrize(
    ("second", "axis"), [(limit(0.04), "0 -1 0"), (limit(0.05), "0 1 0")], ids=["other limits", "the same direction"]
)
def test_a_joint_that_is_no_mirror_image_does_not_move_with_the_gripper(second: str, axis: str) -> None:
    with pytest.raises(GripperGeometryError, match=r"finger links \['left_pad'\] (has no closing|face each)"):
        measure_gripper(jaws(second, axis), "palm", "drive")


@pytest.mark.parametrize(
    ("urdf", "moved"),
    [(jaws(mimic("drive", 1.0)), 0.0), (jaws(mimic("drive", 0.3)), 0.35 * 0.05), (fixed_jaw(), 0.5 * 0.05)],
    ids=["equal strokes", "unequal strokes", "a fixed jaw"],
)
def test_the_middle_between_the_pads_moves_by_half_the_difference_of_their_strokes(urdf: str, moved: float) -> None:
    gripper = measure_gripper(urdf, "palm", "drive")
    for opening in (0.0, gripper.max_opening):
        expected = [0.0, moved * opening / gripper.max_opening, 0.05]
        assert gripper.axes @ gripper.pad_centre_at(opening) == pytest.approx(expected, abs=1e-9)
    assert gripper.is_symmetric == (moved == 0.0)
    assert gripper.position_for(0.0) == pytest.approx(0.0), "the gap closes towards the fixed jaw"
    assert gripper.pad_half_width == pytest.approx(0.01) and gripper.pad_half_height == pytest.approx(0.025)


def test_a_fixed_jaw_counts_as_a_finger_in_front() -> None:
    gripper = measure_gripper(fixed_jaw(), "palm", "drive")
    assert gripper.tips == pytest.approx(np.full(len(gripper.tips), 0.065 + 0.09 / 2))
    assert {part.link for part in gripper.parts if part.is_pad} == {"left_pad", "right_pad"}


def test_jaws_whose_hulls_overlap_over_the_whole_stroke_are_refused() -> None:
    wide = fixed_jaw().replace('size="0.03 0.02 0.09"', 'size="0.03 0.2 0.09"')
    with pytest.raises(GripperGeometryError, match="'left_pad' and 'right_pad' overlap .* into convex elements"):
        measure_gripper(wide, "palm", "drive")


@pytest.mark.parametrize("size", [0.02, 0.05, 0.1])
def test_the_body_around_a_rounded_mesh_has_few_faces_and_is_hardly_larger(size: float) -> None:
    points = np.asarray(trimesh.creation.capsule(size, size / 2, count=[64, 64]).vertices)
    body = convex_hull(points, MESH_TOLERANCE_M)
    assert (body.planes[:, :3] @ points.T + body.planes[:, 3:]).max() < 1e-9, "all of the mesh is inside"
    assert len(body.planes) < len(convex_hull(points).planes) / 4
    corners = HalfspaceIntersection(body.planes, points.mean(axis=0)).intersections
    exact = trimesh.convex.convex_hull(points)
    heights = np.einsum("cfi,fi->cf", corners[:, None] - exact.triangles_center, exact.face_normals)
    assert heights.max() < MESH_TOLERANCE_M, "above a face of the exact hull"


SRDF = '<robot name="jaws"><group name="hand"><joint name="slide_2"/><joint name="slide"/></group></robot>'


def test_the_driven_joint_of_a_hand_is_the_only_one_that_mimics_no_other() -> None:
    assert driven_joint(two_finger_hands.jaws(), SRDF, "hand") == "slide"
    both_driven = two_finger_hands.jaws().replace('<mimic joint="slide"/>', "")
    with pytest.raises(GripperGeometryError, match=r"group 'hand' has 2 driven joints \(slide_2, slide\)"):
        driven_joint(both_driven, SRDF, "hand")
    with pytest.raises(GripperGeometryError, match="the gripper's joint is not known: .*'grip'"):
        driven_joint(two_finger_hands.jaws(), SRDF, "grip")
