# SPDX-License-Identifier: BSD-3-Clause
"""A planner: the straight path to the nearest goal, which collides if an obstacle is in the way."""

import numpy as np

from mbf_method import JointPath, PathRequest, planner


@planner
def new_method(request: PathRequest) -> JointPath:
    """Returns the straight path; `no_path(request)` is the result of a planner without a path."""
    return JointPath(positions=np.array([request.start, request.goals[0]]))


if __name__ == "__main__":
    new_method.serve()
