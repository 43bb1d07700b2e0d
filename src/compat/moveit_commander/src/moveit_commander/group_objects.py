# SPDX-License-Identifier: BSD-3-Clause
"""Objects of a group: attach, detach, pick and place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rospy
from geometry_msgs.msg import Pose, PoseStamped
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    Grasp,
    MoveItErrorCodes,
    PickupAction,
    PickupGoal,
    PlaceAction,
    PlaceGoal,
    PlaceLocation,
)
from moveit_msgs.srv import GraspPlanning, GraspPlanningRequest
from rosgraph.names import ns_join

from moveit_commander.exception import MoveItCommanderException, ServerError
from moveit_commander.group_motion import MOTION_TIMEOUT_S, GroupMotion
from moveit_commander.servers import is_heard

PLACE_KINDS = "Pose, PoseStamped, PlaceLocation, list of PoseStamped or list of PlaceLocation"


class GroupObjects(GroupMotion):
    """Object methods of a group.

    Publishes: attached_collision_object (moveit_msgs/AttachedCollisionObject).
    """

    def __init__(self, name: str, robot_description: str, ns: str, wait_for_servers: float) -> None:
        super().__init__(name, robot_description, ns, wait_for_servers)
        self._attachments = rospy.Publisher(
            ns_join(ns, "attached_collision_object"), AttachedCollisionObject, queue_size=20
        )

    def attach_object(self, object_name: str, link_name: str = "", touch_links: Sequence[str] = ()) -> bool:
        """Attaches an object of the scene to a link.

        Args:
            object_name: Id of the object.
            link_name: Link; "" for the end effector link, or the group's first link without an end effector.
            touch_links: Links that may touch the object; empty for the link only.

        Returns:
            Whether the request was sent; the scene shows whether move_group applied it.
        """
        link = link_name or self._end_effector_link or next(iter(self._group.links), "")
        if not link:
            rospy.logerr("No known link to attach object '%s' to; name one", object_name)
            return False
        message = AttachedCollisionObject(link_name=link, touch_links=list(touch_links) or [link])
        message.object.id, message.object.operation = object_name, CollisionObject.ADD
        return self._publish([message])

    def detach_object(self, name: str = "") -> bool:
        """Detaches all objects of a link of the group, the object with this id, or all objects of the group ("")."""
        links = [name] if name in self._group.links else list(self._group.links) if not name else []
        messages = [AttachedCollisionObject(link_name=link) for link in links] or [AttachedCollisionObject()]
        for message in messages:
            message.object.operation = CollisionObject.REMOVE
            message.object.id = "" if links else name
        return self._publish(messages)

    def pick(self, object_name: str, grasp: Grasp | Sequence[Grasp] = (), plan_only: bool = False) -> int:
        """Picks an object with one of the grasps and returns the error code.

        Args:
            object_name: Id of the object.
            grasp: Grasp or grasps. Without grasps, the service plan_grasps generates them; if it is not available,
                move_group plans the pick without grasps.
            plan_only: Whether to plan without execution.

        Raises:
            ServerError: The action pickup is not available.
        """
        grasps = [grasp] if isinstance(grasp, Grasp) else list(grasp)
        caller = self._servers.action("pickup", PickupAction)
        if not grasps:
            grasps = self._planned_grasps(object_name)
        goal = PickupGoal(
            target_name=object_name,
            end_effector=self._group.end_effector,
            possible_grasps=grasps,
        )
        self._fill_settings(goal, plan_only)
        code = caller.run(goal, self._planning_limit_s() + MOTION_TIMEOUT_S).error_code
        self._check_result(code, "pick")
        return int(code.val)

    def place(self, object_name: str, location: Any = None, plan_only: bool = False) -> bool:
        """Places an attached object; returns whether it succeeded.

        Args:
            object_name: Id of the object.
            location: Pose, or list of alternative locations; None for any location.
            plan_only: Whether to plan without execution.

        Raises:
            ServerError: The action place is not available.
            MoveItCommanderException: The location has an unsupported type.
        """
        goal = PlaceGoal(
            attached_object_name=object_name,
            place_locations=self._place_locations(location),
        )
        self._fill_settings(goal, plan_only)
        caller = self._servers.action("place", PlaceAction)
        result = caller.run(goal, self._planning_limit_s() + MOTION_TIMEOUT_S)
        return self._check_result(result.error_code, "place")

    def _fill_settings(self, goal: PickupGoal | PlaceGoal, plan_only: bool) -> None:
        goal.group_name = self._group.name
        goal.support_surface_name = self._support_surface
        goal.allow_gripper_support_collision = bool(self._support_surface)
        goal.path_constraints, goal.planning_options = self._path_constraints, self._options(plan_only)
        goal.planner_id, goal.allowed_planning_time = self._planner_id, self._planning_time_s

    def _place_locations(self, location: Any) -> list[PlaceLocation]:
        given = location if isinstance(location, list) else [] if location is None else [location]
        return [item if isinstance(item, PlaceLocation) else self._place_location(item) for item in given]

    def _place_location(self, pose: Any) -> PlaceLocation:
        """Returns a location with approach along -z of the planning frame and retreat along -x of the link."""
        if not isinstance(pose, Pose | PoseStamped):
            raise MoveItCommanderException(f"Parameter location must be a {PLACE_KINDS} object; got {type(pose)}")
        location = PlaceLocation(place_pose=self._stamped_pose(pose))
        approach, retreat = location.pre_place_approach, location.post_place_retreat
        approach.direction.header.frame_id = self.get_planning_frame()
        approach.direction.vector.z = -1.0
        approach.min_distance, approach.desired_distance = 0.1, 0.2
        retreat.direction.header.frame_id = self._end_effector_link
        retreat.direction.vector.x = -1.0
        retreat.min_distance, retreat.desired_distance = 0.0, 0.2
        return location

    def _planned_grasps(self, object_name: str) -> list[Grasp]:
        request = GraspPlanningRequest(group_name=self._group.name, support_surfaces=[self._support_surface])
        request.target.id = object_name
        try:
            response = self._servers.call("plan_grasps", GraspPlanning, request)
        except ServerError as error:
            rospy.logwarn(
                "pick of '%s': no grasp is given and no service plans one (%s); give grasps to pick()",
                object_name,
                error,
            )
            return []
        if response.error_code.val != MoveItErrorCodes.SUCCESS or not response.grasps:
            rospy.logwarn(
                "pick of '%s': no grasp is given, and service plan_grasps has %d (code %d); give grasps to pick()",
                object_name,
                len(response.grasps),
                response.error_code.val,
            )
        return list(response.grasps)

    def _publish(self, messages: Sequence[AttachedCollisionObject]) -> bool:
        if not is_heard(self._attachments):
            return False
        for message in messages:
            self._attachments.publish(message)
        return True
