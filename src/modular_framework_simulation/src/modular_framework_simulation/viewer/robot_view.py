# SPDX-License-Identifier: BSD-3-Clause
"""Draws the robot, and the motion that was planned for it."""

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
"""Outset of the ghost's surfaces: negative, so that none lies in a surface of the robot and flickers there."""
_LINE_RGB = (255, 140, 20)
_LINE_WIDTH_PX = 3.0


class RobotView:
    """The robot in a layer.

    Args:
        layer: Where it is drawn.
        text: Its URDF.
        find_package: Looks up the packages of package:// URIs.
        log: Takes a line about a shape that cannot be drawn.

    Attributes:
        links: Its kinematics.
        in_world: Poses of its links, as they are drawn.

    Raises:
        ValueError: The text is no URDF.
        DescriptionError: Its links do not form a tree.
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
        """Puts the robot at joint positions [rad or m]; joints that are left out stay.

        Args:
            positions: By joint.
            base: Pose of the root in the world.
        """
        self._positions |= positions
        self.base = base
        self.in_world = {link: base @ pose for link, pose in self.links.poses(self._positions).items()}
        for link in self._bodies:
            self._layer.place(tree_name(link), self.in_world[link])

    def bodies_carried_by(self, joints: tuple[str, ...]) -> dict[str, list[PlacedBody]]:
        """Returns what is seen of the links that some joints move."""
        moved = self.links.carried_by(joints)
        return {link: bodies for link, bodies in self._bodies.items() if link in moved}


class PlanView:
    """The planned motion: the way of the last link as a line, and a ghost of the robot that moves along it.

    Args:
        layer: Where it is drawn.
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
        """How long the motion takes [s]; 0 without one."""
        return self._plan.duration_s if self._plan is not None else 0.0

    def show(self, plan: Plan | None, robot: RobotView) -> None:
        """Draws the line of a plan; None: nothing."""
        self.hide_ghost()
        self._plan, self._robot = plan, robot
        if self._line is not None:
            self._line.remove()
            self._line = None
        if plan is None:
            return
        way = np.array([(robot.base @ Pose(tuple(point))).position for point in plan.line(robot.links)])
        self._line = self._server.scene.add_line_segments(
            "/plan/path", np.stack([way[:-1], way[1:]], axis=1), colors=_LINE_RGB, line_width=_LINE_WIDTH_PX
        )

    def show_ghost(self, time_s: float) -> None:
        """Draws the robot as it is planned for a time from the beginning [s]."""
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
