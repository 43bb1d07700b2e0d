# SPDX-License-Identifier: BSD-3-Clause
"""Checks the grasps for boxes on a table; run with pytest or python."""

from new_method import new_method

from mbf_method.method_checks import check_grasp_method, local_call
from mbf_method.sample_inputs import grasp_requests


def test_the_grasps_of_boxes_have_no_fault() -> None:
    """Checks frame, units, axes, widths, and equal results under an equal seed."""
    findings = check_grasp_method(local_call(new_method), grasp_requests(new_method.needs_camera))
    assert not findings.faults, "\n".join(findings.faults)


if __name__ == "__main__":
    test_the_grasps_of_boxes_have_no_fault()
