# SPDX-License-Identifier: BSD-3-Clause
"""A planner of your own: RRT-Connect (Kuffner and LaValle, 2000), with collision checks by Pinocchio and Coal."""

from __future__ import annotations

import time

import coal
import numpy as np
import pinocchio

from mbf_method import JointPath, Obstacle, PathRequest, no_path, planner

STEP_RAD = 0.02
MAX_EDGE_RAD = 0.6
SHORTCUTS = 60
SHAPES = {"box": coal.Box, "sphere": coal.Sphere, "cylinder": coal.Cylinder}


class Robot:
    """Collision checks of the robot among the obstacles of a request."""

    def __init__(self, request: PathRequest) -> None:
        self.model = pinocchio.buildModelFromXML(request.urdf)
        self.shapes = pinocchio.buildGeomFromUrdfString(self.model, request.urdf, pinocchio.GeometryType.COLLISION)
        bodies = [self.model.frames[item.parentFrame].name for item in self.shapes.geometryObjects]
        links = len(bodies)
        for number, obstacle in enumerate(request.obstacles):
            self._add(f"obstacle {number}", obstacle)
            bodies.append(obstacle.name)
        allowed = {frozenset(pair) for pair in request.allowed_contacts}
        for first in range(links):
            for second in range(first + 1, len(bodies)):
                if frozenset((bodies[first], bodies[second])) not in allowed and bodies[first] != bodies[second]:
                    self.shapes.addCollisionPair(pinocchio.CollisionPair(first, second))
        self.data, self.shape_data = self.model.createData(), self.shapes.createData()
        self.positions = pinocchio.neutral(self.model)
        for index, name in enumerate(request.robot.joint_names):
            self.positions[self._index(name)] = request.robot.positions[index]
        self.indices = [self._index(name) for name in request.joint_names]

    def _index(self, joint: str) -> int:
        return self.model.joints[self.model.getJointId(joint)].idx_q

    def _add(self, name: str, obstacle: Obstacle) -> None:
        if obstacle.kind not in SHAPES or obstacle.link:
            raise ValueError(
                f"'{obstacle.name}' is a {obstacle.kind} of link '{obstacle.link}', which is not supported"
            )
        shape = SHAPES[obstacle.kind](*obstacle.dimensions)
        pose = pinocchio.SE3(obstacle.pose[:3, :3], obstacle.pose[:3, 3])
        self.shapes.addGeometryObject(pinocchio.GeometryObject(name, 0, 0, pose, shape))

    def is_free(self, values: np.ndarray) -> bool:
        self.positions[self.indices] = values
        return not pinocchio.computeCollisions(
            self.model, self.data, self.shapes, self.shape_data, self.positions, True
        )

    def last_free(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Returns the last free joint vector on the edge, `second` if the whole edge is free."""
        steps = int(np.ceil(np.abs(second - first).max() / STEP_RAD))
        for step in range(1, steps + 1):
            if not self.is_free(first + (second - first) * step / steps):
                return first + (second - first) * (step - 1) / steps
        return second


class Tree:
    """Joint vectors that free edges connect with a root."""

    def __init__(self, roots: np.ndarray) -> None:
        self.vectors, self.parents = list(roots), [-1] * len(roots)

    def extend(self, target: np.ndarray, robot: Robot) -> np.ndarray | None:
        """Returns a new joint vector on the way to the target; None if an obstacle blocks the way."""
        nearest = int(np.argmin(np.linalg.norm(np.array(self.vectors) - target, axis=1)))
        offset = target - self.vectors[nearest]
        fraction = MAX_EDGE_RAD / max(np.abs(offset).max(), 1e-9)
        end = target if fraction >= 1.0 else self.vectors[nearest] + fraction * offset
        reached = robot.last_free(self.vectors[nearest], end)
        if np.array_equal(reached, self.vectors[nearest]):
            return None
        self.vectors.append(reached)
        self.parents.append(nearest)
        return reached

    def branch(self) -> list:
        """Returns the path from the root to the last joint vector."""
        path, index = [], len(self.vectors) - 1
        while index >= 0:
            path.append(self.vectors[index])
            index = self.parents[index]
        return path[::-1]


@planner
def tree_path(request: PathRequest) -> JointPath:
    """Returns the path that joins a tree from the start with a tree from the goals."""
    end_s = time.monotonic() + 0.9 * request.allowed_time_s
    robot, random = Robot(request), np.random.default_rng(request.seed)
    grown, other = Tree(request.start[None]), Tree(request.goals)
    begins_at_start = True
    while time.monotonic() < end_s:
        target = grown.extend(random.uniform(request.lower, request.upper), robot)
        if target is not None:
            while (reached := other.extend(target, robot)) is not None:
                if np.array_equal(reached, target):
                    path = grown.branch() + other.branch()[-2::-1]
                    return JointPath(shortened(path if begins_at_start else path[::-1], robot, random))
        grown, other, begins_at_start = other, grown, not begins_at_start
    return no_path(request)


def shortened(path: list, robot: Robot, random: np.random.Generator) -> np.ndarray:
    """Returns a path in which free edges replace detours."""
    for _ in range(SHORTCUTS):
        first, last = sorted(random.integers(0, len(path), 2))
        if last - first > 1 and np.array_equal(robot.last_free(path[first], path[last]), path[last]):
            path = path[: first + 1] + path[last:]
    return np.array(path)


if __name__ == "__main__":
    tree_path.serve()
