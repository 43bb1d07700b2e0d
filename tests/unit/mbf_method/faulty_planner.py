# SPDX-License-Identifier: BSD-3-Clause
"""A planner of straight paths, with the fault named by its argument in requests for the planner `faulty`."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[3] / "src/mbf_method/src"))

from mbf_method import JointPath, PathRequest, no_path, planner  # noqa: E402

FAULT = sys.argv[1]


@planner
def straight_path(request: PathRequest) -> JointPath:
    path = np.array([request.start, request.goals[0]])
    if request.planner != "faulty":
        return JointPath(path)
    match FAULT:
        case "dies":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hangs":
            time.sleep(600.0)
        case "raises":
            raise ValueError("no roadmap")
        case "returns NaN":
            path[1, 0] = np.nan
        case "has too few columns":
            path = path[:, 1:]
        case "ends elsewhere":
            path[-1, 0] -= 0.5
        case "leaves the limits":
            path = np.array([path[0], request.upper + 0.1, path[1]])
        case "is too large":
            path = np.zeros((10_000, len(request.start)))
        case "has too many points":
            path = np.linspace(path[0], path[1], 101)
        case "finds no path":
            return no_path(request)
    return JointPath(path)


if FAULT == "exits":
    sys.exit(3)
straight_path.serve()
