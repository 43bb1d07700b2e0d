# SPDX-License-Identifier: BSD-3-Clause
"""The digest of a method's sources changes with each module of the method, and with nothing else."""

from __future__ import annotations

import sys
from pathlib import Path

from mbf_method.method_client import MethodClient, MethodLimits, MethodSource
from mbf_method.served_method import GRASPS

PACKAGE = str(Path(__file__).parents[3] / "src/mbf_method/src")
METHOD = """
import sys

sys.path[:0] = {paths!r}

import installed_helper, my_helper
from mbf_method import GraspRequest, Grasps, grasp_method


@grasp_method
def grasps(request: GraspRequest) -> Grasps:
    raise ValueError


grasps.serve()
"""


def test_the_digest_covers_each_module_of_the_method_and_no_installed_package(tmp_path: Path) -> None:
    method, helper = tmp_path / "method.py", tmp_path / "my_helper.py"
    installed = tmp_path / "site-packages" / "installed_helper.py"
    installed.parent.mkdir()
    method.write_text(METHOD.format(paths=[str(installed.parent), PACKAGE]))
    for file in (helper, installed, tmp_path / "unused.py"):
        file.write_text("YAW_STEP = 1\n")

    def digest() -> str:
        client = MethodClient(MethodSource(command=(sys.executable, str(method))), GRASPS, MethodLimits())
        assert client.sources == ""
        client.start()
        client.close()
        return client.sources

    before = digest()
    assert len(before) == 64
    for file in (installed, tmp_path / "unused.py"):
        file.write_text("YAW_STEP = 2\n")
    assert digest() == before
    helper.write_text("YAW_STEP = 2\n")
    of_helper = digest()
    method.write_text(method.read_text() + "# edited\n")
    assert len({before, of_helper, digest()}) == 3
