# SPDX-License-Identifier: BSD-3-Clause
"""A policy: moves all joints to zero, or to the limit nearest to zero, and opens the gripper."""

import numpy as np

from mbf_method import Actions, Observation, policy, task_done

SPEED = 0.25
"""Fraction of the velocity limits."""
REACHED = 0.01


@policy
def new_method(observation: Observation) -> Actions:
    """Returns joint positions on the straight path to the goal; no action once the joints are at the goal."""
    spec, start = observation.actions, observation.robot.positions
    joints = len(start)
    if spec.kind != "positions":
        raise ValueError(f"this policy returns positions, the task needs {spec.kind}")
    goal = np.clip(np.zeros(joints), spec.lower[:joints], spec.upper[:joints])
    if np.abs(goal - start).max() < REACHED:
        return task_done(observation)
    steps = np.arange(1, spec.horizon + 1)[:, None]
    travel = SPEED * spec.max_velocity[:joints] / spec.rate_hz * steps
    actions = np.zeros((spec.horizon, len(spec.names)))
    actions[:, :joints] = start + np.clip(goal - start, -travel, travel)
    return Actions(actions)


if __name__ == "__main__":
    new_method.serve()
