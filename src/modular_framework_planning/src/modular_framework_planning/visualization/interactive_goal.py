# SPDX-License-Identifier: BSD-3-Clause
"""An interactive goal in RViz with stock displays: drag the goal, see whether it is valid, plan and execute."""

from __future__ import annotations

import textwrap
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import Pose, PoseStamped
from moveit_msgs.msg import RobotState
from std_msgs.msg import Empty
from visualization_msgs.msg import Marker, MarkerArray

from modular_framework_planning.errors import ModelError, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.messages.conversions import joint_values, state_message
from modular_framework_planning.messages.multi_dof import goal_values, with_multi_dof
from modular_framework_planning.messages.poses import pose_message, transform_from_pose
from modular_framework_planning.move_group.markers.scene_markers import marker_array_message, robot_markers
from modular_framework_planning.move_group.robot_parameters import load_robot_model
from modular_framework_planning.planning_scene.planning_scene import empty_scene
from modular_framework_planning.robot_model.multi_dof_joint import PLANAR
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel
from modular_framework_planning.visualization.goal_marker import (
    BASE,
    GOAL,
    PLANAR_CONTROLS,
    SIX_DOF_CONTROLS,
    Choice,
    GoalMarker,
)
from modular_framework_planning.visualization.move_group_client import MotionOptions, MoveGroupClient
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.publishing import publish

VALID, COLLIDING, UNREACHABLE = (0.2, 0.8, 0.3, 0.5), (0.9, 0.15, 0.1, 0.6), (0.6, 0.6, 0.6, 0.35)
START_COLOR = (0.2, 0.4, 0.9, 0.4)
RANDOM_ATTEMPTS = 200
TEXT_ABOVE_TIP_M = 0.45  # distance of the text from the hand
TEXT_WIDTH, TEXT_LINES = 60, 5
DRAG_TIMEOUT_S = 2.0  # maximum wait of a plan for a dragged goal
BASE_SCALE = 3.0  # size of the base's marker relative to the tip's marker
MIN_STATE_CHANGE = 1.0e-3  # [rad or m]; smaller motions of the robot do not move the goal
FOLLOW_PERIOD_S = 0.5  # update period of a goal that follows the robot
JOB_END_S = 0.2  # maximum wait for a finished job to release the lock
DEFAULT_PLANNER = "move_group's default"


class InteractiveGoal:
    """An interactive marker at the tip for the goal, ghosts of start and goal, and a menu.

    A group with a planar or floating base has a second marker for the base. Until a goal is set, and again after each
    execution, the goal follows the robot and has no ghost, because move_group may not know the robot's joints at start.

    Publishes: ~goal_ghost, ~start_ghost (visualization_msgs/MarkerArray, latched).
    Interactive marker: ~marker.
    Subscribes: /rviz/moveit/{plan, execute, stop, update_start_state, update_goal_state} (std_msgs/Empty) and
        /rviz/moveit/{update_custom_start_state, update_custom_goal_state} (moveit_msgs/RobotState), as MoveIt's panel.
    Parameters: `parameters/interactive_goal.yaml`.
    """

    def __init__(self, model: RobotModel, client: MoveGroupClient) -> None:
        self._model, self._client = model, client
        self._groups = [group.name for group in model.groups.values() if group.is_chain]
        read = DeclaredParameters("modular_framework_planning", "interactive_goal").values
        group, self._scale_m, self._connection_timeout_s = read("~group", "~marker_scale", "~connection_timeout")
        group_name = group or next(iter(self._groups), "")
        if group_name not in self._groups:
            raise ModelError(
                f"{rospy.resolve_name('~group')} is '{group_name}'; groups with a tip link: "
                f"{', '.join(self._groups) or 'none'}"
            )
        self._group: JointGroup = model.group(group_name)
        self._options = MotionOptions(*read("~planning_time", "~velocity_scaling", "~acceleration_scaling"))
        self._marker = GoalMarker(rospy.resolve_name("~marker"), self._on_drag)
        self._ghosts = {
            name: rospy.Publisher(f"~{name}_ghost", MarkerArray, queue_size=1, latch=True) for name in ("goal", "start")
        }
        self._scene = empty_scene(model)  # for conversions of states
        self._goal: Array = model.default_positions()
        self._goal_is_set = False
        self._goal_changing = threading.Lock()
        self._start: RobotState | None = None
        self._trajectory: Any = None
        self._status = ""
        self._goal_color = VALID
        self._dragged: tuple[str, Pose] | None = None
        self._solving = False
        self._drag_changed = threading.Condition()
        self._job = threading.Lock()

    def connect(self) -> None:
        """Waits for move_group, then shows the marker; raises PlanningError."""
        self._client.connect(self._connection_timeout_s)
        self._goal = self._positions_of(self._client.state())
        self._fill_menu()
        self._show_goal()
        self._show_markers()
        for topic, command in (
            ("plan", self.plan),
            ("execute", self.execute),
            ("stop", self.stop),
            ("update_start_state", self.set_start_to_current),
            ("update_goal_state", self.set_goal_to_current),
        ):
            rospy.Subscriber(f"/rviz/moveit/{topic}", Empty, lambda _, run=command: run(), queue_size=5)
        for topic, setter in (
            ("update_custom_start_state", self._set_start_state),
            ("update_custom_goal_state", self._set_goal_state),
        ):
            rospy.Subscriber(f"/rviz/moveit/{topic}", RobotState, self._on_state, callback_args=setter, queue_size=5)
        threading.Thread(target=self._follow_drags, daemon=True).start()

    # ---------------------------------------------------------------- commands of the menu
    def _fill_menu(self) -> None:
        """Fills the menu with commands, the group's planners and the groups."""
        planners = [
            f"{pipeline}: {planner}" if pipeline else planner
            for pipeline, planner in self._client.planners(self._group.name)
        ]
        commands = {
            "Plan": self.plan,
            "Execute": self.execute,
            "Plan and execute": self.plan_and_execute,
            "Stop": self.stop,
            "Random valid goal": self.set_random_goal,
            "Goal: current state": self.set_goal_to_current,
            "Start: current state": self.set_start_to_current,
            "Start: follow the robot": self.follow_robot,
        }
        choices = [Choice("Planner", [DEFAULT_PLANNER, *planners], self._choose_planner)]
        if len(self._groups) > 1:
            order = [self._group.name, *(name for name in self._groups if name != self._group.name)]
            choices.append(Choice("Group", order, self._choose_group))
        self._marker.fill_menu(list(commands.items()), choices)

    def plan(self) -> None:
        """Plans a motion from start to goal."""
        self._begin("planning", self._plan)

    def execute(self) -> None:
        """Executes the last plan."""
        self._begin("executing", self._execute)

    def plan_and_execute(self) -> None:
        """Plans a motion from start to goal and executes it."""
        self._begin("planning", lambda: self._plan() and self._execute())

    def stop(self) -> None:
        """Stops planning and execution."""
        self._client.stop()

    def set_random_goal(self) -> None:
        """Sets a random valid goal."""
        self._begin("searching for a valid goal", self._random_goal)

    def set_goal_to_current(self) -> None:
        """Sets the goal to the current state."""
        self._run_guarded(lambda: self._set_goal_state(self._client.state()))

    def set_start_to_current(self) -> None:
        """Fixes the start at the current state, even if the robot moves later."""
        self._run_guarded(lambda: self._set_start_state(self._client.state()))

    def follow_robot(self) -> None:
        """Makes motions start at the current state of the robot."""
        self._start = None
        publish(self._ghosts["start"], marker_array_message([], self._model.planning_frame))

    def _choose_planner(self, entry: str) -> None:
        pipeline, _, planner = entry.rpartition(": ")
        self._options = replace(
            self._options, pipeline_id=pipeline, planner_id="" if entry == DEFAULT_PLANNER else planner
        )
        self._set_status(f"planner: {entry}")

    def _choose_group(self, name: str) -> None:
        self._group, self._trajectory = self._model.group(name), None
        self._options = replace(self._options, pipeline_id="", planner_id="")
        self._run_guarded(self._fill_menu)
        self._show_markers()
        self._set_status(f"group: {name}")

    # ---------------------------------------------------------------- jobs, one at a time
    def _begin(self, activity: str, job: Callable[[], Any]) -> None:
        if not self._job.acquire(timeout=JOB_END_S):
            self._set_status(f"not {activity}: busy; stop first")
            return

        def run() -> None:
            try:
                self._set_status(f"{activity} ...")
                self._run_guarded(job)
            finally:
                self._job.release()

        threading.Thread(target=run, daemon=True).start()

    def _run_guarded(self, job: Callable[[], Any]) -> None:
        try:
            job()
        except PlanningError as error:
            self._set_status(error.reason)
        except (rospy.ServiceException, rospy.ROSException) as error:
            self._set_status(f"move_group does not answer: {error}")

    def _plan(self) -> bool:
        with self._drag_changed:
            self._drag_changed.wait_for(lambda: self._dragged is None and not self._solving, DRAG_TIMEOUT_S)
        goal = goal_values(self._model, self._group.joints, self._goal)
        self._trajectory = None
        self._trajectory = self._client.plan(
            self._group.name, self._start or RobotState(is_diff=True), goal, self._options
        )
        points = self._trajectory.joint_trajectory.points
        self._set_status(f"planned: {points[-1].time_from_start.to_sec() if points else 0.0:.1f} s")
        return True

    def _execute(self) -> None:
        if self._trajectory is None:
            self._set_status("nothing is planned; choose Plan first")
            return
        trajectory, self._trajectory = self._trajectory, None
        self._client.execute(trajectory)
        with self._goal_changing:
            self._goal_is_set = False
        self._set_status("executed")

    def _random_goal(self) -> None:
        indices = self._group.indices
        low = np.maximum(self._model.lower[indices], -np.pi)
        high = np.minimum(self._model.upper[indices], np.pi)
        rng = np.random.default_rng()
        for _ in range(RANDOM_ATTEMPTS):
            positions = self._goal.copy()
            positions[indices] = rng.uniform(low, high)
            positions = self._model.with_mimics(positions, frozenset(int(index) for index in indices))
            if not self._client.problem_of(self._group.name, self._state_of(positions)):
                self._set_goal(positions, VALID, "random goal")
                self._move_markers()
                return
        self._set_status(f"none of {RANDOM_ATTEMPTS} random states is valid; is the robot in contact?")

    # ---------------------------------------------------------------- the goal
    def _has_base(self) -> bool:
        """Returns whether the group contains the base."""
        base = self._model.base
        return base is not None and base.variables[0] in self._group.joints

    def _show_markers(self) -> None:
        frame = self._model.planning_frame
        self._marker.show(GOAL, frame, self._tip_pose(), self._scale_m)
        if self._model.base is not None and self._has_base():
            controls = PLANAR_CONTROLS if self._model.base.kind == PLANAR else SIX_DOF_CONTROLS
            self._marker.show(BASE, frame, self._base_pose(), BASE_SCALE * self._scale_m, controls)
        else:
            self._marker.hide(BASE)
        self._marker.apply()

    def _move_markers(self) -> None:
        self._marker.move(GOAL, self._tip_pose())
        self._marker.move(BASE, self._base_pose())
        self._marker.apply()

    def _on_drag(self, marker: str, pose: Pose) -> None:
        with self._drag_changed:
            self._dragged = marker, pose
            self._drag_changed.notify_all()

    def _follow_drags(self) -> None:
        """Solves for the newest dragged pose and skips older poses."""
        while not rospy.is_shutdown():
            with self._drag_changed:
                if self._dragged is None:
                    self._drag_changed.wait(FOLLOW_PERIOD_S)
                drag, self._dragged = self._dragged, None
                self._solving = drag is not None
            if not self._goal_is_set:
                self._run_guarded(self._follow_with_goal)
            if drag is not None:
                marker, pose = drag
                handler = self._place_base if marker == BASE else self._solve
                self._run_guarded(lambda run=handler, target=pose: run(target))
                with self._drag_changed:
                    self._solving = False
                    self._drag_changed.notify_all()

    def _follow_with_goal(self) -> None:
        """Sets the goal to the current state, unless a goal was set."""
        positions = self._positions_of(self._client.state())
        with self._goal_changing:
            if self._goal_is_set or np.allclose(positions, self._goal, rtol=0.0, atol=MIN_STATE_CHANGE):
                return
            self._goal = positions
        self._show_goal()
        self._move_markers()

    def _solve(self, pose: Pose) -> None:
        target = PoseStamped(pose=pose)
        target.header.frame_id = self._model.planning_frame
        seed = self._state_of(self._goal)
        for avoid in (True, False):
            solution = self._client.solve_ik(self._group.name, self._group.tip_link, target, seed, avoid)
            if solution is not None:
                positions = self._positions_of(solution)
                problem = "" if avoid else self._client.problem_of(self._group.name, self._state_of(positions))
                self._set_goal(positions, COLLIDING if problem else VALID, problem or "goal is free")
                self._marker.move(BASE, self._base_pose())
                self._marker.apply()
                return
        self._set_goal(self._goal, UNREACHABLE, "no inverse kinematics solution there")

    def _place_base(self, pose: Pose) -> None:
        """Moves the base of the goal; the other joints stay, so that the tip moves with the base."""
        positions = self._model.with_base(self._goal, transform_from_pose(pose, "the marker of the base"))
        problem = self._client.problem_of(self._group.name, self._state_of(positions))
        self._set_goal(positions, COLLIDING if problem else VALID, problem or "goal is free")
        self._move_markers()

    def _on_state(self, message: RobotState, setter: Callable[[RobotState], None]) -> None:
        self._run_guarded(lambda: setter(message))

    def _set_goal_state(self, state: RobotState) -> None:
        positions = self._positions_of(state)
        problem = self._client.problem_of(self._group.name, self._state_of(positions))
        self._set_goal(positions, COLLIDING if problem else VALID, problem or "goal is free")
        self._move_markers()

    def _set_start_state(self, state: RobotState) -> None:
        positions = self._positions_of(state)
        self._start, self._trajectory = state, None
        ghost = robot_markers(self._model, positions, "start", START_COLOR)
        publish(self._ghosts["start"], marker_array_message(ghost, self._model.planning_frame))

    def _set_goal(self, positions: Array, color: tuple[float, float, float, float], status: str) -> None:
        with self._goal_changing:
            self._goal, self._goal_color, self._trajectory, self._goal_is_set = positions, color, None, True
        self._set_status(status)

    def _set_status(self, status: str) -> None:
        """Shows and logs the status."""
        if status != self._status:
            rospy.loginfo("interactive goal: %s", status)
        self._status = status
        self._show_goal()

    def _show_goal(self) -> None:
        markers: list[Marker] = []
        if self._goal_is_set:  # otherwise the robot is at the goal
            markers = robot_markers(self._model, self._goal, "goal", self._goal_color)
        text = Marker(
            type=Marker.TEXT_VIEW_FACING,
            ns="status",
            text="\n".join(textwrap.wrap(self._status, TEXT_WIDTH)[:TEXT_LINES]),
            pose=self._tip_pose(),
        )
        text.header.frame_id = self._model.planning_frame
        text.pose.position.z += TEXT_ABOVE_TIP_M
        text.scale.z = 0.04
        text.color.r = text.color.g = text.color.b = text.color.a = 1.0
        publish(
            self._ghosts["goal"],
            marker_array_message([*markers, text] if text.text else markers, self._model.planning_frame),
        )

    # ---------------------------------------------------------------- states
    def _tip_pose(self) -> Pose:
        return pose_message(self._model.link_transforms(self._goal)[self._group.tip_link])

    def _base_pose(self) -> Pose:
        return pose_message(self._model.base_transform(self._goal))

    def _positions_of(self, state: RobotState) -> Array:
        source_name, joints = "robot state", state.joint_state
        scene = with_multi_dof(self._scene.with_positions(self._goal), state.multi_dof_joint_state, source_name)
        return self._model.merge(scene.positions, joint_values(self._model, joints.name, joints.position, source_name))

    def _state_of(self, positions: Array) -> RobotState:
        """Returns a diff to the current state, so that held objects stay attached."""
        state = state_message(self._scene, positions, with_attached=False)
        state.is_diff = True
        return state


def main() -> int:
    """Runs the node and returns the exit code."""
    rospy.init_node("interactive_goal")
    try:
        InteractiveGoal(load_robot_model(), MoveGroupClient()).connect()
    except PlanningError as error:
        rospy.logfatal("interactive_goal cannot start: %s", error.reason)
        return 1
    rospy.spin()
    return 0
