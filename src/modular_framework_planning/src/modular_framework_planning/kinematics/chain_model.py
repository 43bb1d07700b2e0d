# SPDX-License-Identifier: BSD-3-Clause
"""Conversion of a robot model to the arrays of the compiled kinematics."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import pinocchio as pin

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.compiled_kinematics import Chain, Tree
from modular_framework_planning.robot_model.robot_model import MAX_CACHED_MODELS, JointGroup, RobotModel


@lru_cache(maxsize=MAX_CACHED_MODELS)
def whole_tree(model: RobotModel) -> Tree:
    """Returns all joints of a robot as arrays, cached per robot."""
    return joint_tree(model)


def joint_tree(model: RobotModel, joints: Sequence[int] | None = None) -> Tree:
    """Returns joints as arrays.

    Args:
        model: Robot model.
        joints: Pinocchio joint ids of a path from the root, each the parent of the next; None for all joints of the
            robot, in the order of a position vector.
    """
    pin_model, data = model.pin_model, model.pin_model.createData()
    joint_ids = range(1, pin_model.njoints) if joints is None else joints
    zeros = np.zeros(pin_model.nq)
    axes, prismatic = [], []
    for joint_id in joint_ids:  # a joint's column of its own Jacobian is its axis, linear above angular
        # Pinocchio returns a one-dimensional array for a tree with one joint.
        jacobian = pin.computeJointJacobian(pin_model, data, zeros, joint_id).reshape(6, -1)
        column = jacobian[:, pin_model.joints[joint_id].idx_v]
        prismatic.append(bool(np.linalg.norm(column[:3]) > 0.5))
        axes.append(column[:3] if prismatic[-1] else column[3:])
    parents = (
        [pin_model.parents[joint_id] - 1 for joint_id in joint_ids] if joints is None else range(-1, len(joint_ids) - 1)
    )
    placements = [pin_model.jointPlacements[joint_id].homogeneous[:3] for joint_id in joint_ids]
    return Tree(
        np.array(parents, dtype=np.int64),
        np.array(placements, dtype=float).reshape(-1, 3, 4),
        np.array(axes, dtype=float).reshape(-1, 3),
        np.array(prismatic, dtype=bool),
    )


BALL_GAIN = 10.0  # radians per unit of a ball joint value; the ball joint then contributes little to distances


def with_ball_joint(chain: Chain, joint: Array, width: int) -> Chain:
    """Returns the chain extended by a ball joint, so that a pose target constrains only the position.

    Args:
        chain: Chain driven by group values.
        joint: Pose of the ball joint in the frame of the chain's tip, shape (4, 4).
        width: Number of group values; the three values of the ball joint come after them.
    """
    ball_placement = (np.vstack([chain.tip, (0.0, 0.0, 0.0, 1.0)]) @ joint)[:3]
    last_index, tree = len(chain.drivers) - 1, chain.tree
    placements = np.concatenate([tree.placements, ball_placement[None], np.tile(np.eye(3, 4), (2, 1, 1))])
    extended_tree = Tree(
        np.concatenate([tree.parents, last_index + np.arange(3)]),
        placements,
        np.vstack([tree.axes, np.eye(3)]),
        np.append(tree.prismatic, np.zeros(3, dtype=bool)),
    )
    return Chain(
        extended_tree,
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
            model: Robot model.
            group: Joints that move the chain.
            last_link: Link at the end of the chain.
        """
        frame = model.pin_model.frames[model.frame_ids[last_link]]
        path = [int(joint_id) for joint_id in model.pin_model.supports[frame.parentJoint] if joint_id > 0]
        self.positions = np.array([joint_id - 1 for joint_id in path], dtype=np.int64)  # indices in a position vector
        columns = {int(joint_id): index for index, joint_id in enumerate(group.indices)}
        followers = {follower: (leader, gain, offset) for follower, leader, gain, offset in model.mimics}
        drivers, gains, offsets = [], [], []
        for index in self.positions.tolist():
            leader, gain, offset = followers.get(index, (index, 1.0, 0.0))
            drivers.append(columns.get(leader, -1))
            gains.append(gain)
            offsets.append(offset)
        self._is_external = np.array(drivers) < 0
        self._chain = Chain(
            joint_tree(model, path),
            np.ascontiguousarray(frame.placement.homogeneous[:3]),
            np.array(drivers, dtype=np.int64),
            np.array(gains),
            np.array(offsets, dtype=float),
        )

    @property
    def is_independent(self) -> bool:
        """Whether only joints of the group move the chain."""
        return not self._is_external.any()

    def with_positions(self, positions: Array) -> Chain:
        """Returns the chain with all joints outside the group fixed at `positions` (positions of the whole robot)."""
        if self.is_independent:
            return self._chain
        return self._chain._replace(offsets=np.where(self._is_external, positions[self.positions], self._chain.offsets))
