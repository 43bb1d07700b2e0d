# SPDX-License-Identifier: BSD-3-Clause
"""A policy of your own: moves the joints to a goal at half of their maximum velocities, then closes the gripper."""

import numpy as np

from mbf_method import Actions, Observation, policy, task_done

GOAL = {"shoulder": 0.4, "elbow": -0.3}
"""Goal of the joints that differ from zero [rad]."""
REACHED_RAD = 0.01


@policy
def reach(observation: Observation) -> Actions:
    """Returns joint positions on the straight path to the goal; no action once the joints are at the goal."""
    spec, robot = observation.actions, observation.robot
    joints = len(robot.joint_names)
    goal = np.array([GOAL.get(name, 0.0) for name in robot.joint_names])
    is_there = np.abs(goal - robot.positions).max() < REACHED_RAD
    has_gripper = len(spec.names) > joints
    if is_there and (not has_gripper or observation.gripper > 0.9):
        return task_done(observation)
    times_s = np.arange(1, spec.horizon + 1)[:, None] / spec.rate_hz
    travel = 0.5 * spec.max_velocity[:joints] * times_s
    actions = np.zeros((spec.horizon, len(spec.names)))
    actions[:, :joints] = robot.positions + np.clip(goal - robot.positions, -travel, travel)
    if has_gripper:
        actions[:, -1] = 1.0 if is_there else 0.0
    return Actions(actions)


if __name__ == "__main__":
    reach.serve()
