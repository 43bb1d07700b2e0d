# SPDX-License-Identifier: BSD-3-Clause
"""Measures two planners of your own on the same problems and writes a table: `my_planner_table.py FILE [GOAL_BIAS]`.

A point moves from one corner of the unit square to the opposite corner between round obstacles. The planners are RRTs;
one of them samples the goal more often.
"""

import csv
import sys
import time

import numpy as np

PROBLEMS, OBSTACLES, RADIUS, STEP, MAX_SAMPLES = 40, 28, 0.07, 0.03, 700
START, GOAL = np.array([0.02, 0.02]), np.array([0.98, 0.98])


def make_problem(seed):
    """Returns the centres of the obstacles, shape (n, 2)."""
    centres = np.random.default_rng(seed).random((OBSTACLES, 2))
    ends = np.linalg.norm(centres[:, None] - [START, GOAL], axis=2).min(axis=1)
    return centres[ends > RADIUS + STEP]


def plan(centres, goal_bias, seed):
    """Returns the length of a path, or None if the samples do not suffice."""
    random = np.random.default_rng(seed)
    nodes, lengths = [START], [0.0]
    for _ in range(MAX_SAMPLES):
        target = GOAL if random.random() < goal_bias else random.random(2)
        distances = np.linalg.norm(np.array(nodes) - target, axis=1)
        nearest = int(distances.argmin())
        step = min(STEP, distances[nearest])
        node = nodes[nearest] + step * (target - nodes[nearest]) / max(distances[nearest], 1e-9)
        if np.linalg.norm(centres - node, axis=1).min() < RADIUS:
            continue
        nodes.append(node)
        lengths.append(lengths[nearest] + step)
        if np.linalg.norm(node - GOAL) < STEP:
            return lengths[-1]
    return None


def main(file, goal_bias=0.3):
    """Writes a row per method and problem."""
    with open(file, "w", newline="") as output:
        table = csv.writer(output)
        table.writerow(["method", "problem", "success", "planning_time [s] lower", "path_length [m] lower", "cause"])
        for seed in range(PROBLEMS):
            centres = make_problem(seed)
            for method, bias in (("uniform", 0.02), ("goal biased", goal_bias)):
                begin = time.perf_counter()
                length = plan(centres, bias, seed)
                row = [time.perf_counter() - begin, length, ""] if length else ["", "", "out of samples"]
                table.writerow([method, f"maze {seed}", int(length is not None), *row])


if __name__ == "__main__":
    main(sys.argv[1], *map(float, sys.argv[2:]))
