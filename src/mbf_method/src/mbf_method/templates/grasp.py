# SPDX-License-Identifier: BSD-3-Clause
"""A grasp method: a grasp from above at the centre of the object, in several closing directions."""

import numpy as np

from mbf_method import GraspRequest, Grasps, grasp_method

DIRECTIONS = 12
TIP_CLEARANCE_M = 0.006


@grasp_method
def new_method(request: GraspRequest) -> Grasps:
    """Returns a grasp for each closing direction in which the object fits between the pads."""
    points, gripper = request.target.points, request.gripper
    centre = (points.max(axis=0) + points.min(axis=0)) / 2
    tips_z = max(request.support_z + TIP_CLEARANCE_M, points[:, 2].max() - gripper.pad_height)
    poses, widths = [], []
    for angle in np.pi / DIRECTIONS * np.arange(DIRECTIONS):
        closing = np.array([np.cos(angle), np.sin(angle), 0.0])
        width = 2 * np.abs((points - centre) @ closing).max()
        if width < gripper.max_opening:
            pose = np.eye(4)
            pose[:3, 0] = closing  # x: closing direction
            pose[:3, 1] = [closing[1], -closing[0], 0.0]
            pose[:3, 2] = [0.0, 0.0, -1.0]  # z: approach direction, from above
            pose[:3, 3] = [centre[0], centre[1], tips_z + gripper.fingertip]
            poses.append(pose)
            widths.append(width)
    return Grasps(
        frame=request.frame,
        poses=np.array(poses).reshape(-1, 4, 4),
        scores=1.0 - np.array(widths) / gripper.max_opening,
        widths=np.array(widths),
    )


if __name__ == "__main__":
    new_method.serve()
