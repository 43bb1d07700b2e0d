# SPDX-License-Identifier: BSD-3-Clause
"""Checks the paths of a planar arm; run with pytest or python."""

from new_method import new_method

from mbf_method.method_checks import check_planner, local_call
from mbf_method.sample_inputs import path_requests


def test_the_paths_of_a_planar_arm_have_no_fault() -> None:
    """Checks start, goal, limits, and equal results under an equal seed."""
    findings = check_planner(local_call(new_method), path_requests())
    assert not findings.faults, "\n".join(findings.faults)


if __name__ == "__main__":
    test_the_paths_of_a_planar_arm_have_no_fault()
