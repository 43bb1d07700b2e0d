# SPDX-License-Identifier: BSD-3-Clause
"""The documented example in a separate environment behaves like every generator; a fault has the right cause."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import rospy
from std_msgs.msg import String

from modular_framework_testing.grasping.generator_conformance import (
    BOX_SIZE,
    BOX_Z,
    GraspGeneratorConformance,
    next_grasp,
)
from modular_framework_testing.ros_session import until

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "docs/examples/my_grasp_method.py"
FAULTY_METHOD = ROOT / "tests/unit/mbf_method/faulty_method.py"
FAULTY_SEED = 13


def make_environment(folder: Path) -> Path:
    """Creates a Python environment with mbf_method and its requirements offline, and returns the interpreter."""
    subprocess.run(["/usr/bin/python3", "-m", "venv", "--without-pip", folder], check=True)
    (packages,) = folder.glob("lib/python3*/site-packages")
    sources = [ROOT / "src/mbf_method/src", Path(np.__file__).parents[1]]
    (packages / "method.pth").write_text("\n".join(map(str, sources)))
    return folder / "bin/python"


class TestExternalGrasps(GraspGeneratorConformance):
    """Grasps of the example."""

    package, node, manner = "external_grasps", "external_grasp_generator", "by the external method"

    @classmethod
    def prepare(cls) -> None:
        python = make_environment(Path(tempfile.mkdtemp()) / "environment")
        rospy.set_param(f"{cls.node}/command", [str(python), str(EXAMPLE)])

    def test_the_best_grasp_of_a_box_closes_below_its_top_across_its_narrow_side(self) -> None:
        self.scene.objects = self.scene.objects[:1]
        self.scene.add_box("box__link", BOX_SIZE, (0.05, 0.5, BOX_Z))
        assert self.generate()[0]
        best = next_grasp().grasp_message
        place = best.grasp.pose.pose.position
        assert (place.x, place.y) == pytest.approx((0.05, 0.5), abs=1e-6)
        # the pads have half a height of 0.025 m, and their centre is 0.01 m behind the tip
        assert place.z == pytest.approx(BOX_Z + BOX_SIZE[2] / 2 - 0.025 - 0.01, abs=1e-3)
        opening = 0.12 - 0.01 - 2 * best.pregrasp.posture.position[0]
        assert opening == pytest.approx(0.04 + 2 * 0.012, abs=1e-3)

    def test_the_node_says_the_digest_of_the_sources_of_the_method(self) -> None:
        assert len(rospy.get_param(f"{self.node}/method_sources")) == 64

    def report_of_a_generation(self) -> dict[str, Any]:
        """Requests grasps from the generator, and returns the report of the component."""
        reports: list[dict[str, Any]] = []
        subscriber = rospy.Subscriber(
            "component_reports", String, lambda message: reports.append(json.loads(message.data))
        )
        until(lambda: bool(subscriber.get_num_connections()), "the generator as a publisher of reports")
        self.generate()
        until(lambda: bool(reports), "a report")
        subscriber.unregister()
        return reports[0]

    def test_the_report_separates_the_times_of_method_queue_and_transport(self) -> None:
        report = self.report_of_a_generation()
        assert report["succeeded"]
        times = [report["figures"][f"{name}_time_s"] for name in ("method", "queue", "transport")]
        assert min(times) >= 0.0
        assert 0.0 < sum(times) < report["wall_s"]
        assert "method_fault" not in report["figures"]

    @pytest.mark.parametrize(
        ("fault", "number", "cause"),
        [
            ("exits", 1, "exited with code 3 before the method was ready"),
            ("dies", 2, "the method died: .* was ended by SIGKILL"),
            ("hangs", 3, "the method returned no result within 1 s"),
            ("raises", 4, "the function of the method raised ValueError: no weights"),
            ("returns NaN", 5, r"scores\[0\] is not finite"),
            ("is too large", 6, "the result is larger than"),
        ],
    )
    def test_a_fault_of_the_method_ends_the_generation_with_its_cause(
        self, fault: str, number: int, cause: str
    ) -> None:
        self.set_parameter("command", [sys.executable, str(FAULTY_METHOD), fault])
        self.set_parameter("time_limit", 1.0)
        self.set_parameter("size_limit", 100_000)
        rospy.set_param("/seed", FAULTY_SEED)
        try:
            report = self.report_of_a_generation()
        finally:
            rospy.set_param("/seed", 1)
        assert not report["succeeded"]
        assert report["figures"]["method_fault"] == number
        assert re.match(f"the method failed: .*{cause}", report["reason"]), report

    def test_after_the_faults_the_method_runs_again_and_no_faulty_process_remains(self) -> None:
        assert self.generate()[0]
        commands = [process.cmdline() for process in psutil.Process().children(recursive=True)]
        assert not [command for command in commands if str(FAULTY_METHOD) in command]
        assert [command for command in commands if str(EXAMPLE) in command]
