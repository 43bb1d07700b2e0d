# SPDX-License-Identifier: BSD-3-Clause
"""Modules that a state imports and Python does not find are reported before the run, without importing anything."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from task_folders import TEMPLATES

from modular_framework_core.files.faults import TaskFault
from modular_framework_core.task_constructor.loading import LoadingError, load_module
from modular_framework_core.task_constructor.pipeline import check_task

STATE = "\n\nclass OpenDoor:\n    def __init__(self, outcomes=('success', 'fail')): pass\n"
TASK = (
    "name: t\nsource: state_machine\noutcomes: [success, fail]\nstates:\n"
    "  - A: {source: open_door, transitions: {success: B, fail: fail}}\n"
    "  - B: {source: open_door, transitions: {success: success, fail: fail}}\n"
)


@pytest.fixture()
def folder(tmp_path: Path) -> Path:
    (tmp_path / "states").mkdir()
    (tmp_path / "t.yaml").write_text(TASK)
    return tmp_path / "states"


def faults(folder: Path, imports: str) -> list[str]:
    (folder / "open_door.py").write_text(imports + STATE)
    try:
        check_task(folder.parent / "t.yaml", [folder], [TEMPLATES])
    except TaskFault as error:
        return [str(fault).replace(str(folder.parent), "") for fault in error.faults]
    return []


INSTALL = "install it, or add its folder to PYTHONPATH"


@pytest.mark.parametrize(
    ("imports", "expected"),
    [
        ("import nowhere_at_all", f"1 imports 'nowhere_at_all', but Python finds no 'nowhere_at_all'; {INSTALL}"),
        (
            "import json\nfrom nowhere_at_all.inner import x",
            f"2 imports 'nowhere_at_all.inner', but Python finds no 'nowhere_at_all'; {INSTALL}",
        ),
        ("import jsn", f"1 imports 'jsn', but Python finds no 'jsn'; {INSTALL}; did you mean 'json'?"),
        (
            "from geometry_msgs.msgs import Pose",
            f"1 imports 'geometry_msgs.msgs', but Python finds no 'geometry_msgs.msgs'; {INSTALL}; did you mean 'msg'?",
        ),
        (
            "import xml.etree.ElementTee",
            "1 imports 'xml.etree.ElementTee', but Python finds no 'xml.etree.ElementTee'; "
            f"{INSTALL}; did you mean 'ElementTree'?",
        ),
        (
            "from modular_framework_core.state_api.framework_sate import FrameworkState",
            "1 imports 'modular_framework_core.state_api.framework_sate', but Python finds no "
            f"'modular_framework_core.state_api.framework_sate'; {INSTALL}; did you mean 'framework_state'?",
        ),
        (
            "from . import doors",
            "1 imports '.', but /states is not nested deeply enough in a package; import it by its full name",
        ),
    ],
)
def test_a_module_that_is_not_found_is_reported_once_with_both_places_and_would_indeed_fail(
    folder: Path, imports: str, expected: str
) -> None:
    assert faults(folder, imports) == [f"/t.yaml:5:17: state 'A': /states/open_door.py:{expected}"]
    with pytest.raises(LoadingError, match="raised (ModuleNotFoundError|ImportError)"):
        load_module(folder / "open_door.py")


def test_a_module_beside_the_state_is_reported_with_how_to_make_it_found(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "my_doors.py").write_text("raise RuntimeError('this must not be run')\n")
    (found,) = faults(folder, "import my_doors")
    assert found.endswith(
        "finds no 'my_doors'; it is beside the state, where Python does not look; add /states to PYTHONPATH"
    )
    monkeypatch.syspath_prepend(str(folder))
    assert faults(folder, "import my_doors") == []
    assert "my_doors" not in sys.modules


def test_imports_relative_to_a_package_are_looked_for_there(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "__init__.py").write_text("raise RuntimeError('this must not be run')\n")
    (folder / "doors.py").write_text("")
    assert "Python finds no 'states'" in faults(folder, "from . import doors")[0]
    monkeypatch.syspath_prepend(str(folder.parent))
    assert faults(folder, "from .doors import x\nfrom . import doors") == []
    assert "finds no 'states.dors'; " in faults(folder, "from .dors import x")[0]
    assert "not nested deeply enough" in faults(folder, "from ..doors import x")[0]


@pytest.mark.parametrize(
    "imports",
    [
        "import os.path\nimport numpy.linalg\nfrom geometry_msgs.msg import Pose\nimport modular_framework_core.srv",
        "try:\n    import nowhere_at_all\nexcept ImportError:\n    nowhere_at_all = None",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import nowhere_at_all",
        "def late():\n    import nowhere_at_all",
        "import sys\nsys.path.insert(0, '/my/doors')\nimport nowhere_at_all",
    ],
)
def test_what_is_there_or_optional_or_cannot_be_known_is_no_fault(folder: Path, imports: str) -> None:
    assert faults(folder, imports) == []


def test_a_module_of_the_states_own_package_that_is_no_python_is_reported(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "__init__.py").write_text("")
    (folder / "doors.py").write_text("class (:\n")
    monkeypatch.syspath_prepend(str(folder.parent))
    found = faults(folder, "from states.doors import x")[0]
    assert "/states/doors.py cannot be read as Python: invalid syntax" in found
