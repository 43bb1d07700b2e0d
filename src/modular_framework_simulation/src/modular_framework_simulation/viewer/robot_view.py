# SPDX-License-Identifier: BSD-3-Clause
"""Shows the robot and its planned motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Colour
from modular_framework_simulation.sensors.robot_visuals import read_robot_visuals
from modular_framework_simulation.viewer.glb_files import PlacedBody, bodies_of_visuals, glb_of
from modular_framework_simulation.viewer.layers import Layer, Look, tree_name
from modular_framework_simulation.viewer.plan_playback import Plan
from modular_framework_simulation.viewer.robot_links import RobotLinks
from modular_framework_urdf.mesh_paths import PackageFinder
from modular_framework_urdf.urdf_reader import read_urdf

_GHOST: Colour = (1.0, 0.55, 0.1, 0.5)
_GHOST_OUTSET_M = -0.001
"""Negative outset of the ghost's surfaces, which would otherwise flicker in the robot's surfaces."""
_LINE_RGB = (255, 140, 20)
_LINE_WIDTH_PX = 3.0


class RobotView:
    """Shows the robot in a layer.

    Args:
        layer: Layer of the robot.
        text: URDF of the robot.
        find_package: Function that finds the packages of package:// URIs.
        log: Function that logs a shape that cannot be drawn.

    Attributes:
        links: Forward kinematics of the robot.
        in_world: Displayed poses of the links in the world frame, by name.

    Raises:
        ValueError: The text is not a valid URDF.
        DescriptionError: The links do not form a tree.
    """

    def __init__(self, layer: Layer, text: str, find_package: PackageFinder, log: Callable[[str], None]) -> None:
        self.links = RobotLinks(read_urdf(text))
        self._layer = layer
        self._positions: dict[str, float] = {}
        self.base = Pose()
        layer.clear()
        visuals = read_robot_visuals(text, find_package, log)
        self._bodies = {link: bodies_of_visuals(shapes, log) for link, shapes in visuals.items()}
        for link, bodies in self._bodies.items():
            layer.add(tree_name(link), glb_of(bodies))
        self.in_world: dict[str, Pose] = {}
        self.place({}, self.base)

    def place(self, positions: Mapping[str, float], base: Pose) -> None:
        """Moves the robot to joint positions; other joints keep their positions.

        Args:
            positions: Positions by joint name [rad or m].
            base: Pose of the root link in the world frame.
        """
        self._positions |= positions
        self.base = base
        self.in_world = {link: base @ pose for link, pose in self.links.poses(self._positions).items()}
        for link in self._bodies:
            self._layer.place(tree_name(link), self.in_world[link])

    def bodies_carried_by(self, joints: tuple[str, ...]) -> dict[str, list[PlacedBody]]:
        """Returns the bodies of the links that some joints move, by link name."""
        moved = self.links.carried_by(joints)
        return {link: bodies for link, bodies in self._bodies.items() if link in moved}


class PlanView:
    """Shows the planned motion: the path of the last moving link as a line, and a moving ghost of the robot.

    Args:
        layer: Layer of the ghost.
        server: The viser server.
    """

    def __init__(self, layer: Layer, server: Any) -> None:
        self._layer, self._server = layer, server
        self._line: Any = None
        self._plan: Plan | None = None
        self._robot: RobotView | None = None
        self._links: tuple[str, ...] = ()

    @property
    def duration_s(self) -> float:
        """Returns the duration of the motion [s]; 0 without a motion."""
        return self._plan.duration_s if self._plan is not None else 0.0

    def show(self, plan: Plan | None, robot: RobotView) -> None:
        """Shows the line of a plan, or hides the line for None."""
        self.hide_ghost()
        self._plan, self._robot = plan, robot
        if self._line is not None:
            self._line.remove()
            self._line = None
        if plan is None:
            return
        path = np.array([(robot.base @ Pose(tuple(point))).position for point in plan.line(robot.links)])
        self._line = self._server.scene.add_line_segments(
            "/plan/path", np.stack([path[:-1], path[1:]], axis=1), colors=_LINE_RGB, line_width=_LINE_WIDTH_PX
        )

    def show_ghost(self, time_s: float) -> None:
        """Shows the ghost at a time from the start of the plan [s]."""
        plan, robot = self._plan, self._robot
        if plan is None or robot is None:
            return
        if not self._links:
            bodies = robot.bodies_carried_by(plan.joints)
            for link, shapes in bodies.items():
                self._layer.add(f"ghost/{tree_name(link)}", glb_of(shapes, _GHOST, _GHOST_OUTSET_M), Look.GHOST)
            self._links = tuple(bodies)
        poses = robot.links.poses(plan.positions_at(time_s))
        for link in self._links:
            self._layer.place(f"ghost/{tree_name(link)}", robot.base @ poses[link])

    def hide_ghost(self) -> None:
        """Removes the ghost."""
        for link in self._links:
            self._layer.remove(f"ghost/{tree_name(link)}")
        self._links = ()
