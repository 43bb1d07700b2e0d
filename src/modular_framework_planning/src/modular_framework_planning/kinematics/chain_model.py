# SPDX-License-Identifier: BSD-3-Clause
"""Puts the joints of a robot model into the plain arrays that compiled kinematics works on."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import pinocchio as pin

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import Chain, Tree
from modular_framework_planning.robot_model.robot_model import KEPT_MODELS, JointGroup, RobotModel


@lru_cache(maxsize=KEPT_MODELS)
def whole_tree(model: RobotModel) -> Tree:
    """Returns all joints of a robot as arrays; the same ones again for the same robot."""
    return tree_of(model)


def tree_of(model: RobotModel, joints: Sequence[int] | None = None) -> Tree:
    """Returns joints as arrays.

    Args:
        model: the robot.
        joints: Pinocchio's numbers of a path from the root, each the parent of the next; all joints of the robot, in
            the order of a position vector, by default.
    """
    pin_model, data = model.pin_model, model.pin_model.createData()
    chosen = range(1, pin_model.njoints) if joints is None else joints
    zeros = np.zeros(pin_model.nq)
    axes, prismatic = [], []
    for number in chosen:  # a joint's own column of its Jacobian is its axis: linear on top, angular below
        jacobian = pin.computeJointJacobian(pin_model, data, zeros, number).reshape(6, -1)  # flat for a single joint
        column = jacobian[:, pin_model.joints[number].idx_v]
        prismatic.append(bool(np.linalg.norm(column[:3]) > 0.5))
        axes.append(column[:3] if prismatic[-1] else column[3:])
    parents = [pin_model.parents[number] - 1 for number in chosen] if joints is None else range(-1, len(chosen) - 1)
    placements = [pin_model.jointPlacements[number].homogeneous[:3] for number in chosen]
    return Tree(
        np.array(parents, dtype=np.int64),
        np.array(placements, dtype=float).reshape(-1, 3, 4),
        np.array(axes, dtype=float).reshape(-1, 3),
        np.array(prismatic, dtype=bool),
    )


BALL_GAIN = 10.0  # radians a unit of a ball joint's value: next to free beside the real joints


def with_ball_joint(chain: Chain, joint: Array, width: int) -> Chain:
    """Returns a chain that ends in a ball joint, so that reaching a pose of its tip asks for the position alone.

    Args:
        chain: the chain; group values drive it.
        joint: pose of the ball joint in the frame of the chain's tip, shape (4, 4).
        width: number of group values; the three of the ball joint come after them, each BALL_GAIN radians a unit.
    """
    end = (np.vstack([chain.tip, (0.0, 0.0, 0.0, 1.0)]) @ joint)[:3]
    last, tree = len(chain.drivers) - 1, chain.tree
    placements = np.concatenate([tree.placements, end[None], np.tile(np.eye(3, 4), (2, 1, 1))])
    longer = Tree(
        np.concatenate([tree.parents, last + np.arange(3)]),
        placements,
        np.vstack([tree.axes, np.eye(3)]),
        np.append(tree.prismatic, np.zeros(3, dtype=bool)),
    )
    return Chain(
        longer,
        np.eye(3, 4),
        np.concatenate([chain.drivers, width + np.arange(3)]),
        np.append(chain.gains, np.full(3, BALL_GAIN)),
        np.append(chain.offsets, np.zeros(3)),
    )


class ChainModel:
    """The kinematic chain from the planning frame to the last link of a group."""

    def __init__(self, model: RobotModel, group: JointGroup, last_link: str) -> None:
        """Reads the chain from the model.

        Args:
            model: the robot.
            group: whose joints move the chain.
            last_link: at the end of the chain.
        """
        frame = model.pin_model.frames[model.frame_ids[last_link]]
        path = [int(number) for number in model.pin_model.supports[frame.parentJoint] if number > 0]
        self.positions = np.array([number - 1 for number in path], dtype=np.int64)  # indices in a position vector
        column = {int(number): index for index, number in enumerate(group.indices)}
        followers = {follower: (leader, gain, offset) for follower, leader, gain, offset in model.mimics}
        drivers, gains, offsets = [], [], []
        for index in self.positions.tolist():
            leader, gain, offset = followers.get(index, (index, 1.0, 0.0))
            drivers.append(column.get(leader, -1))
            gains.append(gain)
            offsets.append(offset)
        self._rest = np.array(drivers) < 0
        self._chain = Chain(
            tree_of(model, path),
            np.ascontiguousarray(frame.placement.homogeneous[:3]),
            np.array(drivers, dtype=np.int64),
            np.array(gains),
            np.array(offsets, dtype=float),
        )

    @property
    def is_own(self) -> bool:
        """Whether no joint outside the group moves the chain."""
        return not self._rest.any()

    def at(self, positions: Array) -> Chain:
        """Returns the chain with the joints outside the group where they are in `positions` (whole robot)."""
        if self.is_own:
            return self._chain
        return self._chain._replace(offsets=np.where(self._rest, positions[self.positions], self._chain.offsets))
