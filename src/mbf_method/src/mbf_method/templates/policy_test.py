# SPDX-License-Identifier: BSD-3-Clause
"""Checks the actions for a planar arm; run with pytest or python."""

from new_method import new_method

from mbf_method.method_checks import check_policy, local_call
from mbf_method.sample_inputs import observations


def test_the_actions_for_a_planar_arm_have_no_fault() -> None:
    """Checks shape, limits, units, and equal results under an equal seed."""
    findings = check_policy(local_call(new_method), observations())
    assert not findings.faults, "\n".join(findings.faults)


if __name__ == "__main__":
    test_the_actions_for_a_planar_arm_have_no_fault()
