# SPDX-License-Identifier: BSD-3-Clause
"""A policy that moves all joints by a step, with the fault named by its argument after the first chunk."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[3] / "src/mbf_method/src"))

from mbf_method import Actions, Observation, policy, task_done  # noqa: E402

__version__ = "1.2"
FAULT = sys.argv[1]
STEP_RAD = 0.02
CHUNKS = 3
"""Number of chunks after which the policy is done."""


@policy
def steps(observation: Observation) -> Actions:
    spec, joints = observation.actions, len(observation.robot.joint_names)
    if observation.step >= CHUNKS * spec.horizon and FAULT != "never ends":
        return task_done(observation)
    actions = np.zeros((spec.horizon, len(spec.names)))
    actions[:, :joints] = observation.robot.positions + STEP_RAD * np.arange(1, spec.horizon + 1)[:, None]
    if observation.step == 0:
        return Actions(actions)
    match FAULT:
        case "dies":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hangs":
            time.sleep(600.0)
        case "is late":
            time.sleep(2.0)
        case "is slow":
            time.sleep(0.3)
        case "raises":
            raise ValueError("no weights")
        case "returns NaN":
            actions[1, 0] = np.nan
        case "has too few columns":
            actions = actions[:, 1:]
        case "has too few actions":
            actions = actions[:-1]
        case "is too large":
            actions = np.zeros((1_000_000, len(spec.names)))
        case "is twice too large":
            actions = np.zeros(100_000 // actions.itemsize)
        case "leaves the limits":
            actions[0, :joints] = 100.0
    return Actions(actions)


if FAULT == "exits":
    sys.exit(3)
if FAULT == "never listens":
    time.sleep(600.0)
steps.serve()
