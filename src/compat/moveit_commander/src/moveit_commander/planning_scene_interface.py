# SPDX-License-Identifier: BSD-3-Clause
"""Modifies and reads the planning scene of move_group: PlanningSceneInterface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rospy
from geometry_msgs.msg import Pose, PoseStamped
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, PlanningScene, PlanningSceneComponents
from moveit_msgs.srv import (
    ApplyPlanningScene,
    ApplyPlanningSceneRequest,
    GetPlanningScene,
    GetPlanningSceneRequest,
)
from rosgraph.names import ns_join
from shape_msgs.msg import SolidPrimitive

from moveit_commander import allowed_collisions, collision_objects
from moveit_commander.exception import ServerError
from moveit_commander.object_region import Region, inside
from moveit_commander.roscpp_initializer import ensure_node
from moveit_commander.servers import Servers, is_heard

acm_set_default = allowed_collisions.set_default
acm_set_allowed = allowed_collisions.set_allowed
Names = Sequence[str]
Vector = Sequence[float]


class PlanningSceneInterface:
    """Adds, attaches, removes and lists objects.

    In synchronous mode, the service apply_planning_scene applies each change before the method returns. Otherwise
    changes are published on collision_object and attached_collision_object.
    """

    def __init__(self, ns: str = "", synchronous: bool = True) -> None:
        """Creates the interface; connects to move_group on the first call, or advertises the topics.

        Args:
            ns: Namespace of move_group's endpoints.
            synchronous: Whether methods wait for move_group.
        """
        ensure_node()
        self._servers = Servers(ns)
        self._synchronous = synchronous
        self._pub_co: Any = None
        self._pub_aco: Any = None
        if not synchronous:
            self._pub_co = rospy.Publisher(ns_join(ns, "collision_object"), CollisionObject, queue_size=100)
            self._pub_aco = rospy.Publisher(
                ns_join(ns, "attached_collision_object"), AttachedCollisionObject, queue_size=100
            )

    def add_object(self, collision_object: CollisionObject) -> None:
        """Adds an object, or replaces the object with the same id."""
        self._submit(collision_object)

    def add_sphere(self, name: str, pose: PoseStamped, radius: float = 1) -> None:
        """Adds a sphere.

        Args:
            name: Id of the object.
            pose: Pose of the object in the frame of its header.
            radius: Radius [m].
        """
        self._submit(self.make_sphere(name, pose, radius))

    def add_cylinder(self, name: str, pose: PoseStamped, height: float, radius: float) -> None:
        """Adds a cylinder along z.

        Args:
            name: Id of the object.
            pose: Pose of the object in the frame of its header.
            height: Height [m].
            radius: Radius [m].
        """
        self._submit(self.make_cylinder(name, pose, height, radius))

    def add_cone(self, name: str, pose: PoseStamped, height: float, radius: float) -> None:
        """Adds a cone along z.

        Args:
            name: Id of the object.
            pose: Pose of the object in the frame of its header.
            height: Height [m].
            radius: Radius of the base [m].
        """
        self._submit(self.make_cone(name, pose, height, radius))

    def add_mesh(self, name: str, pose: PoseStamped, filename: str, size: Vector = (1, 1, 1)) -> None:
        """Adds the mesh of a file.

        Args:
            name: Id of the object.
            pose: Pose of the object in the frame of its header.
            filename: Path of the mesh file.
            size: Scale along x, y and z.
        """
        self._submit(self.make_mesh(name, pose, filename, size))

    def add_box(self, name: str, pose: PoseStamped, size: Vector = (1, 1, 1)) -> None:
        """Adds a box.

        Args:
            name: Id of the object.
            pose: Pose of the object in the frame of its header.
            size: Edge lengths along x, y and z [m].
        """
        self._submit(self.make_box(name, pose, size))

    def add_plane(self, name: str, pose: PoseStamped, normal: Vector = (0, 0, 1), offset: float = 0) -> None:
        """Adds the plane normal . p + offset = 0 in the pose's frame.

        Args:
            name: Id of the object.
            pose: Pose of the object in the frame of its header.
            normal: Normal vector.
            offset: Offset [m].
        """
        self._submit(self.make_plane(name, pose, normal, offset))

    def attach_object(
        self,
        object: AttachedCollisionObject | CollisionObject | str,  # noqa: A002 - public name
        link: str | None = None,
        touch_links: Names | None = None,
    ) -> None:
        """Attaches a new object or an object of the scene to a link.

        Args:
            object: New object, or id of an object of the scene.
            link: Link; None for the link of the AttachedCollisionObject.
            touch_links: Links that may touch the object; None for the link only.
        """
        if isinstance(object, str):
            object = collision_objects.existing(object)  # noqa: A001
        attached = object if isinstance(object, AttachedCollisionObject) else AttachedCollisionObject(object=object)
        if link is not None:
            attached.link_name = link
        attached.touch_links = [attached.link_name] if touch_links is None else list(touch_links)
        self._submit(attached)

    def attach_mesh(
        self,
        link: str,
        name: str,
        pose: PoseStamped | None = None,
        filename: str = "",
        size: Vector = (1, 1, 1),
        touch_links: Names | None = None,
    ) -> None:
        """Attaches the mesh of a file, or the object with this id.

        Args:
            link: Link to which the object is attached.
            name: Id of the object.
            pose: Pose of the new object; None for the object with this id.
            filename: Path of the mesh file; empty for the object with this id.
            size: Scale along x, y and z.
            touch_links: Links that may touch the object; None for the link only.
        """
        new = self.make_mesh(name, pose, filename, size) if pose is not None and filename else name
        self.attach_object(new, link, touch_links)

    def attach_box(
        self,
        link: str,
        name: str,
        pose: PoseStamped | None = None,
        size: Vector = (1, 1, 1),
        touch_links: Names | None = None,
    ) -> None:
        """Attaches a box, or the object with this id.

        Args:
            link: Link to which the object is attached.
            name: Id of the object.
            pose: Pose of the new object; None for the object with this id.
            size: Edge lengths along x, y and z [m].
            touch_links: Links that may touch the object; None for the link only.
        """
        self.attach_object(name if pose is None else self.make_box(name, pose, size), link, touch_links)

    def attach_sphere(
        self, link: str, name: str, pose: PoseStamped | None = None, radius: float = 1, touch_links: Names | None = None
    ) -> None:
        """Attaches a sphere, or the object with this id.

        Args:
            link: Link to which the object is attached.
            name: Id of the object.
            pose: Pose of the new object; None for the object with this id.
            radius: Radius [m].
            touch_links: Links that may touch the object; None for the link only.
        """
        self.attach_object(name if pose is None else self.make_sphere(name, pose, radius), link, touch_links)

    def attach_cylinder(
        self,
        link: str,
        name: str,
        pose: PoseStamped | None = None,
        height: float = 1,
        radius: float = 1,
        touch_links: Names | None = None,
    ) -> None:
        """Attaches a cylinder along z, or the object with this id.

        Args:
            link: Link to which the object is attached.
            name: Id of the object.
            pose: Pose of the new object; None for the object with this id.
            height: Height [m].
            radius: Radius [m].
            touch_links: Links that may touch the object; None for the link only.
        """
        self.attach_object(name if pose is None else self.make_cylinder(name, pose, height, radius), link, touch_links)

    def clear(self) -> None:
        """Removes every object from the scene, including attached objects."""
        self.remove_attached_object()
        self.remove_world_object()

    def remove_world_object(self, name: str | None = None) -> None:
        """Removes an object, or (None) all objects that are not attached."""
        self._submit(CollisionObject(id=name or "", operation=CollisionObject.REMOVE))

    def remove_attached_object(self, link: str | None = None, name: str | None = None) -> None:
        """Detaches an object, all objects of a link, or all objects; they stay in the world."""
        attached = AttachedCollisionObject(link_name=link or "")
        attached.object.id, attached.object.operation = name or "", CollisionObject.REMOVE
        self._submit(attached)

    def get_known_object_names(self, with_type: bool = False) -> list[str]:
        """Returns the ids of the world's objects; with_type restricts them to objects with a type."""
        return [
            item.id
            for item in self._world(PlanningSceneComponents.WORLD_OBJECT_NAMES)
            if item.type.key or not with_type
        ]

    def get_known_object_names_in_roi(
        self, minx: float, miny: float, minz: float, maxx: float, maxy: float, maxz: float, with_type: bool = False
    ) -> list[str]:
        """Returns the ids of objects whose shapes all have their origin in a box.

        Args:
            minx: Minimum x of the box in the planning frame [m].
            miny: Minimum y [m].
            minz: Minimum z [m].
            maxx: Maximum x [m].
            maxy: Maximum y [m].
            maxz: Maximum z [m].
            with_type: Whether to omit objects without a type.
        """
        region = Region((minx, miny, minz), (maxx, maxy, maxz))
        return [
            item.id
            for item in self._world(PlanningSceneComponents.WORLD_OBJECT_GEOMETRY)
            if (item.type.key or not with_type) and inside(item, region)
        ]

    def get_object_poses(self, object_ids: Names) -> dict[str, Pose]:
        """Returns the poses of objects in the planning frame, keyed by id; unknown ids are skipped."""
        return {name: item.pose for name, item in self.get_objects(list(object_ids)).items() if name in object_ids}

    def get_objects(self, object_ids: Names = ()) -> dict[str, CollisionObject]:
        """Returns objects of the world, keyed by id; without ids, all objects."""
        return {
            item.id: item
            for item in self._world(PlanningSceneComponents.WORLD_OBJECT_GEOMETRY)
            if item.id in object_ids or not object_ids
        }

    def get_attached_objects(self, object_ids: Names = ()) -> dict[str, AttachedCollisionObject]:
        """Returns attached objects, keyed by id; without ids, all attached objects."""
        scene = self.get_planning_scene(PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS)
        return {
            item.object.id: item
            for item in scene.robot_state.attached_collision_objects
            if item.object.id in object_ids or not object_ids
        }

    def get_planning_scene(self, components: int) -> PlanningScene:
        """Returns the components of move_group's scene selected by bits of moveit_msgs/PlanningSceneComponents."""
        request = GetPlanningSceneRequest(PlanningSceneComponents(components))
        return self._servers.call("get_planning_scene", GetPlanningScene, request).scene

    def apply_planning_scene(self, planning_scene_message: PlanningScene) -> bool:
        """Applies a change of the scene; returns whether move_group accepted it."""
        request = ApplyPlanningSceneRequest(planning_scene_message)
        return bool(self._servers.call("apply_planning_scene", ApplyPlanningScene, request).success)

    @staticmethod
    def make_box(name: str, pose: PoseStamped, size: Vector) -> CollisionObject:
        """Returns a box, as in `add_box`.

        Args:
            name: Name of the object.
            pose: Pose of the box's centre.
            size: Lengths of the edges along x, y and z [m].
        """
        return collision_objects.primitive(name, pose, SolidPrimitive.BOX, size)

    @staticmethod
    def make_mesh(name: str, pose: PoseStamped, filename: str, scale: Vector = (1, 1, 1)) -> CollisionObject:
        """Returns an object with the mesh of a file, as in `add_mesh`.

        Args:
            name: Name of the object.
            pose: Pose of the mesh's origin.
            filename: Mesh file.
            scale: Factors along x, y and z.
        """
        return collision_objects.mesh(name, pose, filename, scale)

    @staticmethod
    def make_sphere(name: str, pose: PoseStamped, radius: float) -> CollisionObject:
        """Returns a sphere, as in `add_sphere`.

        Args:
            name: Name of the object.
            pose: Pose of the sphere's centre.
            radius: Radius [m].
        """
        return collision_objects.primitive(name, pose, SolidPrimitive.SPHERE, [radius])

    @staticmethod
    def make_cylinder(name: str, pose: PoseStamped, height: float, radius: float) -> CollisionObject:
        """Returns a cylinder, as in `add_cylinder`.

        Args:
            name: Name of the object.
            pose: Pose of the cylinder's centre; the axis is z.
            height: Height [m].
            radius: Radius [m].
        """
        return collision_objects.primitive(name, pose, SolidPrimitive.CYLINDER, [height, radius])

    @staticmethod
    def make_cone(name: str, pose: PoseStamped, height: float, radius: float) -> CollisionObject:
        """Returns a cone, as in `add_cone`.

        Args:
            name: Name of the object.
            pose: Pose of the cone's centre; the cone stands along z.
            height: Height [m].
            radius: Radius of the base [m].
        """
        return collision_objects.primitive(name, pose, SolidPrimitive.CONE, [height, radius])

    @staticmethod
    def make_plane(name: str, pose: PoseStamped, normal: Vector = (0, 0, 1), offset: float = 0) -> CollisionObject:
        """Returns a plane, as in `add_plane`.

        Args:
            name: Name of the object.
            pose: Pose of the frame in which normal and offset are given.
            normal: Normal of the plane.
            offset: Constant of the plane normal . p + offset = 0 [m].
        """
        return collision_objects.plane(name, pose, normal, offset)

    def _world(self, components: int) -> list[CollisionObject]:
        return list(self.get_planning_scene(components).world.collision_objects)

    def _submit(self, item: CollisionObject | AttachedCollisionObject) -> None:
        attached = isinstance(item, AttachedCollisionObject)
        if not self._synchronous:
            publisher = self._pub_aco if attached else self._pub_co
            if is_heard(publisher):
                publisher.publish(item)
            return
        scene = PlanningScene(is_diff=True)
        scene.robot_state.is_diff = True
        if attached:
            scene.robot_state.attached_collision_objects = [item]
        else:
            scene.world.collision_objects = [item]
        if not self.apply_planning_scene(scene):
            name = item.object.id if attached else item.id
            raise ServerError(
                f"service {self._servers.resolve('apply_planning_scene')}: the change of object '{name}' "
                "was refused and the scene is as before; the log of move_group gives the reason"
            )
