# SPDX-License-Identifier: BSD-3-Clause
"""Scene messages: objects, attaching, the matrix, padding and octomaps on the wire, and diffs a client can follow."""

from __future__ import annotations

import random
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

pytest.importorskip("moveit_msgs.msg", reason="source the workspace: the messages are not built")

from geometry_msgs.msg import Point, Pose, Quaternion, TransformStamped  # noqa: E402
from moveit_msgs.msg import (  # noqa: E402
    AllowedCollisionEntry,
    AttachedCollisionObject,
    CollisionObject,
    LinkPadding,
    LinkScale,
    ObjectColor,
    PlanningScene,
    PlanningSceneComponents,
)
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive  # noqa: E402

from modular_framework_planning.errors import PlanningError  # noqa: E402
from modular_framework_planning.messages.scene_conversions import (  # noqa: E402
    apply_attached_object,
    apply_collision_object,
    with_matrix_of,
)
from modular_framework_planning.messages.scene_difference import difference_message  # noqa: E402
from modular_framework_planning.messages.scene_messages import apply_scene, scene_message  # noqa: E402
from modular_framework_planning.octomap.encoding import write_binary  # noqa: E402
from modular_framework_planning.octomap.octree import Octree  # noqa: E402
from modular_framework_planning.octomap.voxel_map import VoxelMap, empty_map  # noqa: E402
from modular_framework_planning.planning_scene.padding import Padding, uniform_padding  # noqa: E402
from modular_framework_planning.planning_scene.planning_scene import PlanningScene as Scene  # noqa: E402
from modular_framework_planning.planning_scene.planning_scene import empty_scene  # noqa: E402
from modular_framework_planning.robot_model.robot_model import RobotModel  # noqa: E402

PALM, WRIST = "ezgripper_palm_link", "wrist_3_link"
OPERATIONS = {
    "add": CollisionObject.ADD,
    "append": CollisionObject.APPEND,
    "move": CollisionObject.MOVE,
    "remove": CollisionObject.REMOVE,
}


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.0, turn: float = 0.0) -> Pose:
    return Pose(Point(x, y, z), Quaternion(0.0, 0.0, np.sin(turn / 2), np.cos(turn / 2)))


def body(name: str, operation: str = "add", at: Pose | None = None, boxes: int = 2, frame: str = "") -> CollisionObject:
    message = CollisionObject(id=name, operation=OPERATIONS[operation], pose=at or pose(1.0))
    message.header.frame_id = frame
    message.primitives = [SolidPrimitive(SolidPrimitive.BOX, [0.1, 0.1, 0.1]) for _ in range(boxes)]
    message.primitive_poses = [pose(0.0, 0.2 * number) for number in range(boxes)]
    return message


def everything(name: str) -> CollisionObject:
    """An object of every kind of shape, with a subframe."""
    message = CollisionObject(id=name, operation=CollisionObject.ADD, pose=pose(1.0, 0.0, 0.5, 1.0))
    message.primitives = [
        SolidPrimitive(SolidPrimitive.BOX, [0.1, 0.2, 0.3]),
        SolidPrimitive(SolidPrimitive.SPHERE, [0.1]),
        SolidPrimitive(SolidPrimitive.CYLINDER, [0.4, 0.1]),
        SolidPrimitive(SolidPrimitive.CONE, [0.5, 0.2]),
    ]
    message.primitive_poses = [pose(0.1 * number) for number in range(4)]
    message.meshes = [Mesh([MeshTriangle([0, 1, 2])], [Point(0, 0, 0), Point(0.1, 0, 0), Point(0, 0.1, 0)])]
    message.mesh_poses = [pose(0, 0.5)]
    message.planes, message.plane_poses = [Plane([0.0, 0.0, 1.0, 3.0])], [pose()]
    message.subframe_names, message.subframe_poses = ["handle"], [pose(0, 0, 0.2)]
    return message


@pytest.fixture
def scene(model: RobotModel) -> Scene:
    return empty_scene(model, model.merge(model.default_positions(), {"shoulder_lift_joint": -1.57}))


def translation(scene: Scene, frame: str) -> np.ndarray:
    return np.array(scene.frame_transform(frame).translation)


def test_every_kind_of_shape_comes_back_as_it_was_sent(scene: Scene) -> None:
    sent = everything("all")
    (got,) = scene_message(apply_collision_object(scene, sent), 0).world.collision_objects
    assert [tuple(item.dimensions) for item in got.primitives] == [tuple(item.dimensions) for item in sent.primitives]
    assert got.meshes == sent.meshes and list(got.planes[0].coef) == [0.0, 0.0, 1.0, 3.0]
    assert got.subframe_names == ["handle"] and got.pose.position == sent.pose.position
    assert [p.position.x for p in got.primitive_poses] == pytest.approx([0.0, 0.1, 0.2, 0.3])


def test_move_takes_the_object_and_its_shapes_with_own_poses(scene: Scene) -> None:
    scene = apply_collision_object(scene, body("b"))
    move = CollisionObject(id="b", operation=CollisionObject.MOVE, pose=pose(2.0))
    moved = apply_collision_object(scene, move)
    assert np.allclose(translation(moved, "b"), [2, 0, 0])
    assert moved.objects["b"].shapes is scene.objects["b"].shapes
    move.primitive_poses = [pose(0, 0, 1), pose(0, 0, 2)]
    moved = apply_collision_object(scene, move)
    assert [float(place.translation[2]) for _, place in moved.objects["b"].shapes] == [1.0, 2.0]
    move.primitive_poses = [pose()]
    with pytest.raises(PlanningError, match="got 1 shape poses for 2 shapes"):
        apply_collision_object(scene, move)
    with pytest.raises(PlanningError, match="'c' does not exist"):
        apply_collision_object(scene, CollisionObject(id="c", operation=CollisionObject.MOVE, pose=pose()))


def test_an_object_of_one_shape_moves_by_its_shapes_pose_as_it_was_added(scene: Scene) -> None:
    add = body("b", boxes=1)
    add.pose, add.primitive_poses = Pose(), [pose(1.0)]
    scene = apply_collision_object(scene, add)
    move = CollisionObject(id="b", operation=CollisionObject.MOVE, primitive_poses=[pose(3.0)])
    scene = apply_collision_object(scene, move)
    assert np.allclose(translation(scene, "b"), [3, 0, 0])
    assert np.allclose(scene.objects["b"].shapes[0][1].translation, 0.0)


def test_subframes_are_frames_for_objects_attached_ones_and_slashes_in_names(scene: Scene) -> None:
    first = everything("shelf/upper")
    scene = apply_collision_object(scene, first)
    handle = "shelf/upper/handle"
    assert np.allclose(translation(scene, handle), [1.0, 0.0, 0.7])
    scene = apply_collision_object(scene, body("cup", at=pose(0, 0, 0.1), frame=handle))
    assert np.allclose(translation(scene, "cup"), [1.0, 0.0, 0.8])
    held = AttachedCollisionObject(link_name=PALM, object=everything("shelf/upper"))
    held.object.header.frame_id = PALM
    attached = apply_attached_object(scene, held)
    palm = attached.model.link_transforms(attached.positions)[PALM]
    expected = (
        palm
        * pin.SE3(pin.utils.rotate("z", 1.0), np.array([1.0, 0.0, 0.5]))
        * pin.SE3(np.eye(3), np.array([0, 0, 0.2]))
    )
    assert np.allclose(attached.frame_transform(handle).homogeneous, expected.homogeneous)
    with pytest.raises(PlanningError, match="shelf/upper/handle"):
        scene.frame_transform("shelf/upper/door")


def test_append_adds_shapes_and_subframes_where_they_were_meant(scene: Scene) -> None:
    scene = apply_collision_object(scene, body("b", at=pose(1.0, turn=0.5)))
    more = body("b", "append", at=pose(2.0), boxes=1)
    more.subframe_names, more.subframe_poses = ["tip"], [pose(0, 0, 1)]
    scene = apply_collision_object(scene, more)
    assert len(scene.objects["b"].shapes) == 3
    assert np.allclose((scene.objects["b"].pose * scene.objects["b"].shapes[2][1]).translation, [2, 0, 0])
    assert np.allclose(translation(scene, "b/tip"), [2, 0, 1])


def test_detaching_asks_for_the_right_link_and_without_a_name_takes_all_of_a_link(scene: Scene) -> None:
    for name, link in (("a", PALM), ("b", PALM), ("c", WRIST)):
        scene = apply_collision_object(scene, body(name))
        attach = AttachedCollisionObject(link_name=link, touch_links=[PALM])
        attach.object.id, attach.object.operation = name, CollisionObject.ADD
        scene = apply_attached_object(scene, attach)
    assert not scene.objects and np.allclose(translation(scene, "a"), [1, 0, 0])
    release = AttachedCollisionObject(link_name=WRIST)
    release.object.operation, release.object.id = CollisionObject.REMOVE, "a"
    with pytest.raises(PlanningError, match="attached to 'ezgripper_palm_link', not to 'wrist_3_link'"):
        apply_attached_object(scene, release)
    release.object.id, release.link_name = "", PALM
    released = apply_attached_object(scene, release)
    assert set(released.objects) == {"a", "b"} and set(released.attached) == {"c"}
    assert np.allclose(translation(released, "a"), [1, 0, 0])
    again = AttachedCollisionObject(link_name=WRIST)
    again.object.id = "a"
    moved_over = apply_attached_object(scene, again)
    assert moved_over.attached["a"].link == WRIST and np.allclose(translation(moved_over, "a"), [1, 0, 0])


def test_a_matrix_that_was_read_and_sent_back_means_the_same(scene: Scene) -> None:
    message = PlanningScene().allowed_collision_matrix
    message.entry_names = ["a", "b", "c"]
    message.entry_values = [
        AllowedCollisionEntry(row) for row in ([False, True, False], [True, False, False], [False, False, False])
    ]
    message.default_entry_names, message.default_entry_values = ["a", "<octomap>"], [True, True]
    matrix = with_matrix_of(scene, message).acm
    assert matrix.allows("a", "b") and not matrix.allows("a", "c"), "an entry goes before a default"
    assert matrix.allows("a", "new") and matrix.allows("<octomap>", "new") and not matrix.allows("b", "new")
    back = PlanningScene()
    from modular_framework_planning.messages.scene_conversions import write_matrix

    write_matrix(matrix, back.allowed_collision_matrix)
    assert back.allowed_collision_matrix.entry_names == ["a", "b", "c", "<octomap>"]
    row = back.allowed_collision_matrix.entry_values[3].enabled
    assert row == [True, True, True, True], "the matrix holds verdicts, defaults applied"
    again = with_matrix_of(scene, back.allowed_collision_matrix).acm
    bodies = ["a", "b", "c", "<octomap>", "new"]
    assert all(again.allows(x, y) == matrix.allows(x, y) for x in bodies for y in bodies)


def test_an_orientation_that_was_not_filled_in_is_the_identity(scene: Scene, caplog: pytest.LogCaptureFixture) -> None:
    given, empty = body("b"), body("b")
    for item in (empty, empty.primitive_poses[1]):
        (item.pose if item is empty else item).orientation = Quaternion()
    placed = [apply_collision_object(scene, item).objects["b"] for item in (given, empty)]
    for one, other in zip(*([item.pose, *(pose for _, pose in item.shapes)] for item in placed), strict=True):
        assert one.isApprox(other)
    assert "collision object 'b': quaternion xyzw 0 0 0 0 has norm 0; the identity 0 0 0 1 is used" in caplog.text


def test_objects_of_a_whole_scene_may_be_given_in_frames_of_tf(scene: Scene) -> None:
    seen = scene.with_fixed_frames({"camera": pin.SE3(np.eye(3), np.array([0.3, 0.2, 1.5]))})
    message = PlanningScene(is_diff=False)
    message.world.collision_objects = [body("crate", frame="camera", at=pose(0.1))]
    after = apply_scene(seen, message)
    assert list(after.objects) == ["crate"]
    assert after.objects["crate"].pose.translation == pytest.approx([0.4, 0.2, 1.5])


def test_an_object_takes_its_colour_with_it(scene: Scene) -> None:
    scene = apply_collision_object(scene, body("b")).with_colors({"b": (1.0, 0.0, 0.0, 1.0), "c": (0.0, 1.0, 0.0, 1.0)})
    for name in ("b", ""):
        remove = CollisionObject(id=name, operation=CollisionObject.REMOVE)
        gone = apply_collision_object(scene, remove)
        assert gone.colors == {"c": (0.0, 1.0, 0.0, 1.0)}
        message = difference_message(scene, gone)
        assert message is not None and message.is_diff, "the removal says it, not a whole new scene"
        assert apply_scene(scene, message).colors == gone.colors
    attach = AttachedCollisionObject(link_name=PALM)
    attach.object.id = "b"
    assert apply_attached_object(scene, attach).colors == scene.colors


def test_a_message_with_nothing_but_defaults_keeps_the_entries(scene: Scene) -> None:
    message = PlanningScene(is_diff=True)
    message.allowed_collision_matrix.default_entry_names = [WRIST, "<octomap>"]
    message.allowed_collision_matrix.default_entry_values = [True, False]
    changed = apply_scene(scene, message)
    assert dict(changed.acm.defaults) == {WRIST: True, "<octomap>": False}
    assert changed.acm.entries == scene.acm.entries and changed.acm.allows(WRIST, "crate")
    message.allowed_collision_matrix.default_entry_values = [True]
    with pytest.raises(PlanningError, match="2 default_entry_names and 1 default_entry_values"):
        apply_scene(scene, message)


def test_padding_and_scale_are_margins_that_never_fall_short(scene: Scene) -> None:
    change = PlanningScene(is_diff=True)
    change.link_padding = [LinkPadding(WRIST, 0.02)]
    change.link_scale = [LinkScale("forearm_link", 1.1)]
    padded = apply_scene(scene, change)
    assert padded.geometry_version > scene.geometry_version
    margins: dict[str, list[float]] = {}
    for item, margin in zip(scene.model.link_geometries, padded.link_margins(), strict=True):
        margins.setdefault(item.link, []).append(float(margin))
        if item.link == "forearm_link":
            points = np.array(item.geometry.vertices())
            center = (points.min(axis=0) + points.max(axis=0)) / 2
            assert margin >= 0.1 * np.linalg.norm(points - center, axis=1).max() - 1e-9
    assert margins[WRIST] == [0.02] and margins["upper_arm_link"] == [0.0]
    sent = scene_message(padded, PlanningSceneComponents.LINK_PADDING_AND_SCALING)
    assert {item.link_name: item.padding for item in sent.link_padding}[WRIST] == 0.02
    assert {item.link_name: item.scale for item in sent.link_scale}["forearm_link"] == 1.1
    uniform = scene.with_padding(uniform_padding(scene.model.frame_ids, 0.01, 1.0, objects=0.005, attached=0.003))
    assert np.allclose(uniform.link_margins(), 0.015) and uniform.attached_padding() == pytest.approx(0.008)
    for bad, text in ((LinkPadding("nowhere", 0.1), "nowhere"), (LinkPadding(WRIST, -0.1), "at least 0 m")):
        change.link_padding = [bad]
        with pytest.raises(PlanningError, match=text):
            apply_scene(scene, change)
    with pytest.raises(PlanningError, match="above 0"):
        Padding(scales={WRIST: 0.0})


def voxels(seed: int) -> VoxelMap:
    points = np.random.default_rng(seed).uniform(-1, 1, (50, 3))
    return empty_map(0.1).with_point_cloud(np.zeros(3), points, np.empty((0, 3)), np.empty((0, 3)))


def test_an_octomap_comes_and_goes_in_both_encodings(scene: Scene) -> None:
    change = PlanningScene(is_diff=True)
    tree = change.world.octomap.octomap
    tree.id, tree.resolution, tree.binary = "OcTree", 0.1, True
    tree.data = np.frombuffer(write_binary(voxels(1)), np.int8).tolist()
    change.world.octomap.origin = pose(0, 0, 1.0)
    mapped = apply_scene(scene, change)
    octree = mapped.obstacles()[-1]
    assert octree.name == "<octomap>" and np.allclose(octree.pose.translation, [0, 0, 1])
    assert np.array_equal(octree.shapes[0][0].voxels.occupied_keys, voxels(1).occupied_keys)
    sent = scene_message(mapped, PlanningSceneComponents.OCTOMAP)
    assert not sent.world.collision_objects and not sent.world.octomap.octomap.binary
    sent.is_diff = True
    assert np.array_equal(
        apply_scene(scene, sent).obstacles()[-1].shapes[0][0].voxels.keys, octree.shapes[0][0].voxels.keys
    )
    assert apply_scene(mapped, PlanningScene(is_diff=True)).octomap is octree, "no octomap in a diff: no change"
    assert apply_scene(mapped, PlanningScene(is_diff=False)).octomap is None
    gone = PlanningScene(is_diff=True)
    gone.world.octomap.octomap.id = "cleared"
    assert apply_scene(mapped, gone).octomap is None
    tree.id = "ColorOcTree"
    with pytest.raises(PlanningError, match="ColorOcTree"):
        apply_scene(scene, change)


def test_each_component_is_answered_alone(scene: Scene) -> None:
    color = ObjectColor(id="b")
    color.color.r = 1.0
    frame = TransformStamped(child_frame_id="camera")
    frame.header.frame_id, frame.transform.rotation.w = WRIST, 1.0
    change = PlanningScene(is_diff=True, name="room", object_colors=[color], fixed_frame_transforms=[frame])
    change.world.collision_objects = [body("b")]
    scene = apply_scene(scene, change).with_octomap(Octree(voxels(2)))
    parts = PlanningSceneComponents
    filled: dict[int, Callable[[PlanningScene], object]] = {
        parts.SCENE_SETTINGS: lambda m: m.name == "room" and m.robot_model_name,
        parts.ROBOT_STATE: lambda m: m.robot_state.joint_state.name,
        parts.WORLD_OBJECT_NAMES: lambda m: m.world.collision_objects and not m.world.collision_objects[0].primitives,
        parts.WORLD_OBJECT_GEOMETRY: lambda m: m.world.collision_objects and m.world.collision_objects[0].primitives,
        parts.OCTOMAP: lambda m: m.world.octomap.octomap.data,
        parts.TRANSFORMS: lambda m: {item.child_frame_id for item in m.fixed_frame_transforms} == {"world", "camera"},
        parts.ALLOWED_COLLISION_MATRIX: lambda m: m.allowed_collision_matrix.entry_names,
        parts.LINK_PADDING_AND_SCALING: lambda m: m.link_padding and m.link_scale,
        parts.OBJECT_COLORS: lambda m: m.object_colors[0].color.r == 1.0 if m.object_colors else False,
    }
    for part in filled:
        message = scene_message(scene, part)
        for other, is_filled in filled.items():
            overlap = {part, other} == {parts.WORLD_OBJECT_NAMES, parts.WORLD_OBJECT_GEOMETRY}
            if not overlap:
                assert bool(is_filled(message)) == (part == other), (part, other)
    complete = scene_message(scene, 0)
    assert all(is_filled(complete) for part, is_filled in filled.items() if part != parts.WORLD_OBJECT_NAMES)


def summary(scene: Scene) -> dict[str, object]:
    """What two scenes must have in common to be the same."""

    def of(thing: object) -> tuple[object, ...]:
        return (
            np.round(thing.pose.homogeneous, 6).tolist(),
            [(type(shape).__name__, np.round(place.homogeneous, 6).tolist()) for shape, place in thing.shapes],
            {name: np.round(place.homogeneous, 6).tolist() for name, place in thing.subframes.items()},
        )

    octomap = (
        None
        if scene.octomap is None or not len(scene.octomap.shapes[0][0].centers)
        else (scene.octomap.shapes[0][0].voxels.keys.tolist(), np.round(scene.octomap.pose.homogeneous, 6).tolist())
    )
    names = scene.acm.names
    links = scene.model.frame_ids
    return {
        "objects": {name: of(item) for name, item in scene.objects.items()},
        "attached": {name: (of(item.body), item.link, item.touch_links) for name, item in scene.attached.items()},
        "positions": np.round(scene.positions, 3).tolist(),
        "name": scene.name,
        "colors": scene.colors,
        "matrix": (
            set(names),
            [scene.acm.allows(a, b) for a in sorted(names) for b in sorted(names)],
            scene.acm.defaults,
        ),
        "octomap": octomap,
        "frames": {name: np.round(place.homogeneous, 6).tolist() for name, place in scene.fixed_frames.items()},
        "padding": [(scene.padding.links.get(n, 0.0), scene.padding.scales.get(n, 1.0)) for n in links],
    }


def random_change(scene: Scene, dice: random.Random) -> Scene:
    """One thing a client may do."""
    name = dice.choice("abcd")
    link = dice.choice([PALM, WRIST])
    at = pose(dice.uniform(-1, 1), dice.uniform(-1, 1), dice.uniform(0, 1), dice.uniform(-3, 3))
    attach = AttachedCollisionObject(link_name=link, touch_links=[link])
    attach.object.id = name
    diff = PlanningScene(is_diff=True)
    color = ObjectColor(id=name)
    color.color.g = 0.5
    frame = TransformStamped(child_frame_id=f"frame_{name}")
    frame.header.frame_id, frame.transform.rotation.w = link, 1.0
    release = AttachedCollisionObject()
    release.object.operation = CollisionObject.REMOVE
    matrix = scene.acm.with_entry(name, link, dice.random() < 0.5)
    pan = scene.model.merge(scene.positions, {"shoulder_pan_joint": dice.uniform(-3, 3)})
    diff.link_padding = [LinkPadding(link, dice.uniform(0, 0.1))]
    full_scene = PlanningScene(is_diff=False, name="anew")
    full_scene.world.collision_objects = [everything(name)]
    choices: list[Callable[[], Scene]] = [
        lambda: apply_collision_object(scene, body(name, "add", at, dice.randint(1, 3), dice.choice(["", link]))),
        lambda: apply_collision_object(scene, body(name, "append", at, 1)),
        lambda: apply_collision_object(scene, CollisionObject(id=name, operation=CollisionObject.MOVE, pose=at)),
        lambda: apply_collision_object(scene, CollisionObject(id=name, operation=CollisionObject.REMOVE)),
        lambda: apply_collision_object(scene, everything(name)),
        lambda: apply_attached_object(scene, attach),
        lambda: apply_attached_object(scene, attach),
        lambda: apply_attached_object(scene, release),
        lambda: scene.with_acm(matrix),
        lambda: scene.with_positions(pan),
        lambda: apply_scene(scene, diff),
        lambda: apply_scene(scene, PlanningScene(is_diff=True, object_colors=[color], fixed_frame_transforms=[frame])),
        lambda: scene.with_octomap(Octree(voxels(dice.randint(0, 9))) if dice.random() < 0.6 else None),
        lambda: apply_scene(scene, full_scene) if dice.random() < 0.3 else scene,
    ]
    try:
        return dice.choice(choices)()
    except PlanningError:  # nothing to move, to attach or to detach
        return scene


@pytest.mark.parametrize("seed", range(12))
def test_a_client_that_applies_every_diff_has_the_same_scene(scene: Scene, seed: int) -> None:
    dice = random.Random(seed)
    client = apply_scene(empty_scene(scene.model), scene_message(scene, 0))
    published = scene
    for step in range(40):
        scene = random_change(scene, dice)
        if dice.random() < 0.3:
            continue  # several changes are published as one
        message = difference_message(published, scene)
        published = scene
        if message is not None:
            client = apply_scene(client, message)
        assert summary(client) == summary(scene), f"step {step}"
    assert difference_message(scene, scene) is None
