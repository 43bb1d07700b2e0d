# SPDX-License-Identifier: BSD-3-Clause
"""A method with the fault named by its argument, for `tests/unit/mbf_method/test_method_faults.py`."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[3] / "src/mbf_method/src"))

from mbf_method import GraspRequest, Grasps, grasp_method, served_method  # noqa: E402

FAULT = sys.argv[1]
FAULTY_SEED = 13
"""Seed of the requests that trigger the fault."""


@grasp_method(camera=FAULT == "needs a camera")
def grasps_in_a_row(request: GraspRequest) -> Grasps:
    count = 3
    if request.seed == FAULTY_SEED:
        if FAULT == "dies":
            os.kill(os.getpid(), signal.SIGKILL)
        if FAULT == "hangs":
            time.sleep(600.0)
        if FAULT == "raises":
            raise ValueError("no weights")
        if FAULT == "returns nothing":
            return None
        if FAULT == "is too large":
            count = 10_000
    if FAULT == "takes its time":
        time.sleep(0.2)
    scores = np.full(count, np.nan if FAULT == "returns NaN" else 0.5)
    if request.camera is not None:
        scores = np.array([request.camera.colour.max(), request.camera.depth.min(), request.camera.depth.max()])
    return Grasps(request.frame, np.tile(np.eye(4), (count, 1, 1)), scores, np.full(count, 0.04))


if FAULT == "exits":
    sys.exit(3)
if FAULT == "never listens":
    time.sleep(600.0)
if FAULT == "has another version":
    served_method.VERSION += 1
grasps_in_a_row.serve()
