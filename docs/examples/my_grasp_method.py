# SPDX-License-Identifier: BSD-3-Clause
"""A grasp method of your own: grasps from above, across the object's narrow horizontal directions."""

import numpy as np

from mbf_method import GraspRequest, Grasps, grasp_method

DIRECTIONS = 36
TIP_CLEARANCE_M = 0.006


@grasp_method
def narrow_grasps(request: GraspRequest) -> Grasps:
    """Returns a grasp for each closing direction in which the object fits between the pads."""
    points = request.target.points
    angles = np.pi / DIRECTIONS * np.arange(DIRECTIONS)
    closing = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(DIRECTIONS)])
    across = np.column_stack([np.sin(angles), -np.cos(angles), np.zeros(DIRECTIONS)])

    along_closing, along_across = points @ closing.T, points @ across.T
    widths = np.ptp(along_closing, axis=0)
    middle_closing = (along_closing.max(axis=0) + along_closing.min(axis=0)) / 2
    middle_across = (along_across.max(axis=0) + along_across.min(axis=0)) / 2

    poses = np.tile(np.eye(4), (DIRECTIONS, 1, 1))
    poses[:, :3, 0] = closing
    poses[:, :3, 1] = across
    poses[:, :3, 2] = [0.0, 0.0, -1.0]  # the hand approaches from above
    poses[:, :3, 3] = middle_closing[:, None] * closing + middle_across[:, None] * across
    lowest = request.support_z + request.gripper.fingertip + TIP_CLEARANCE_M
    poses[:, 2, 3] = max(points[:, 2].max() - request.gripper.pad_height / 2, lowest)

    fits = widths < request.gripper.max_opening
    scores = 1.0 - widths / request.gripper.max_opening
    return Grasps(frame=request.frame, poses=poses[fits], scores=scores[fits], widths=widths[fits])


if __name__ == "__main__":
    narrow_grasps.serve()
