# SPDX-License-Identifier: BSD-3-Clause
"""The wheel has every module that its modules import, and depends on nothing of ROS."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / "tests" / "layers"))
from source_tree import read_source_tree  # noqa: E402

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
IMPORT_NAMES = {"pyyaml": "yaml"}
DEPENDENCIES = [text.partition(">=") for text in PROJECT["project"]["dependencies"]]
OTHERS = {"PIL", "coacd", "kaleido", "manifold3d", "markupsafe", "numba", "trimesh"}
"""Package of the extra `figures`, package that jinja2 needs, and imports in functions that statistics and reports do not call."""


def wheel_files() -> set[Path]:
    """Python files of the wheel, from the settings of its build."""
    wheel = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]
    paths = [ROOT / name for name in wheel["only-include"]]
    assert all(path.exists() for path in paths)
    files = {file for path in paths for file in (path.rglob("*.py") if path.is_dir() else [path])}
    return {file for file in files if not any(file.match(pattern) for pattern in wheel["exclude"])}


def test_a_module_of_the_wheel_imports_modules_and_dependencies_of_the_wheel() -> None:
    tree, files = read_source_tree(ROOT / "src"), wheel_files()
    modules = {name for name, file in tree.files.items() if ROOT / file in files}
    assert len(modules) == len(files) > 150
    known = {IMPORT_NAMES.get(name, name) for name, _, _ in DEPENDENCIES} | {*modules, *sys.stdlib_module_names}
    foreign = {each.imported: each.importer for each in tree.imports if each.importer in modules}
    missing = {name: importer for name, importer in foreign.items() if name not in known}
    assert missing.keys() == OTHERS, missing



def test_the_wheel_asks_for_the_versions_that_the_tests_use() -> None:
    pins = [line.split()[0].partition("==") for line in (ROOT / "requirements.in").read_text().splitlines() if "==" in line]
    versions = {name: version for name, _, version in pins}
    assert {name: version for name, _, version in DEPENDENCIES}.items() <= versions.items()
