# SPDX-License-Identifier: BSD-3-Clause
"""The documents hold: links lead to pages and headings that exist, and the task of the first lesson is in order."""

from __future__ import annotations

import itertools
import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest

from modular_framework_core.files.default_folders import framework_home
from modular_framework_core.files.faults import FaultList
from modular_framework_core.files.located_yaml import loads
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue
from modular_framework_core.task_constructor.task_builder import TaskBuilder
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue
from modular_framework_planning.numba_cache import cache_folder

ROOT = Path(__file__).parents[3]
STATES = ROOT / "src/modular_framework_states/src/modular_framework_states/states"
TEMPLATES = ROOT / "src/modular_framework_core/templates"
LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)")
MODULE = re.compile(r"(?:^\s*from|python3 -m) (modular_framework_\w+\.[\w.]*\w)", re.MULTILINE)
ENDS = (".py", "/__init__.py")
PATH = re.compile(r"`((?:src|docs|tests|benchmarks)/[\w./*-]+)`")


def documents() -> list[Path]:
    command = ["git", "ls-files", "-z", "*.md"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, check=False).stdout.decode()
    found = [ROOT / name for name in listed.split("\0") if name]
    found = found or [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *ROOT.glob("src/**/*.md")]
    return sorted(file for file in found if file.exists())


def anchors(file: Path) -> set[str]:
    """The anchors that GitHub makes of the headings of a page."""
    text = re.sub(r"```.*?```", "", file.read_text(), flags=re.DOTALL)
    headings = re.findall(r"^#+ +(.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", documents(), ids=lambda file: str(file.relative_to(ROOT)))
def test_links_lead_to_pages_and_headings_that_exist(document: Path) -> None:
    text = re.sub(r"```.*?```", "", document.read_text(), flags=re.DOTALL)
    for link in LINK.findall(text):
        if "://" in link:
            continue
        name, _, anchor = link.partition("#")
        target = (document.parent / name).resolve() if name else document
        assert target.exists(), f"{document}: {link}"
        if anchor:
            assert anchor in anchors(target), f"{document}: {link}; headings are {sorted(anchors(target))}"


@pytest.mark.parametrize("document", sorted((ROOT / "docs").rglob("*.md")), ids=lambda file: file.name)
def test_files_that_a_page_names_exist(document: Path) -> None:
    missing = [path for path in PATH.findall(document.read_text()) if not list(ROOT.glob(path))]
    assert not missing


def test_modules_that_pages_import_or_run_exist() -> None:
    files = {str(file) for file in (ROOT / "src").rglob("*.py")}
    named = {(page.name, name) for page in documents() for name in MODULE.findall(page.read_text())}
    assert len(named) > 5
    assert not [
        item
        for item in named
        if not any(file.endswith(f"/{item[1].replace('.', '/')}{end}") for file in files for end in ENDS)
    ]


def test_the_table_of_packages_is_complete() -> None:
    packages = {manifest.parent.name for manifest in (ROOT / "src").rglob("package.xml")}
    readme = (ROOT / "README.md").read_text()
    assert not {name for name in packages if not re.search(rf"\b{name}\b", readme)}


def test_every_package_has_a_readme() -> None:
    folders = [file.parent for file in (ROOT / "src").rglob("package.xml") if "interfaces" not in file.parts]
    assert not [folder.name for folder in folders if not (folder / "README.md").exists()]


def test_every_usual_change_touches_at_most_three_files() -> None:
    sections = re.split(r"^## (.+)$", (ROOT / "docs/contributing.md").read_text(), flags=re.MULTILINE)[1:]
    changes = dict(zip(sections[::2], sections[1::2], strict=True))
    for other in ("Before a change", "Places that look alike"):
        del changes[other]
    assert len(changes) == 15
    assert all(PATH.search(text) for text in changes.values())
    assert not [name for name, text in changes.items() if re.search(r"^4\.", text, re.MULTILINE)]


def test_the_page_on_installation_names_all_folders_outside_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("XDG_CACHE_HOME", "ROS_HOME"):
        monkeypatch.delenv(name, raising=False)
    folders = [framework_home(), cache_folder().parent, Path.home() / ".ros/log"]
    page = (ROOT / "docs/installation.md").read_text()
    assert not [folder for folder in folders if f"| `~/{folder.relative_to(Path.home())}` |" not in page]


def test_pages_agree_on_the_disk_space() -> None:
    (amount,) = re.findall(r"^\| disk \| ([\d.]+ GB) ", (ROOT / "docs/installation.md").read_text(), re.MULTILINE)
    assert f"needs {amount} of disk space" in (ROOT / "README.md").read_text()


def test_the_task_of_the_first_lesson_is_in_order() -> None:
    block = re.search(r"```yaml\n(.*?)```", (ROOT / "docs/first_task.md").read_text(), re.DOTALL)
    assert block is not None
    faults = FaultList()
    builder = TaskBuilder(StateCatalogue([STATES]), TemplateCatalogue([TEMPLATES]), faults)
    assert builder.build(loads(block[1], "first.yaml", faults), "first.yaml").name == "to_stability"


def test_the_table_of_launch_arguments_has_every_argument_with_a_documented_name() -> None:
    launch = ElementTree.parse(ROOT / "src/modular_framework_api/launch/start_framework.launch")
    arguments = {arg.attrib["name"] for arg in launch.iterfind("arg")}
    lines = (ROOT / "docs/configuration.md").read_text().splitlines()
    start = next(number for number, line in enumerate(lines) if line.startswith("| `simulation` |"))
    rows = itertools.takewhile(lambda line: line.startswith("|"), lines[start:])
    documented = {name for row in rows for name in re.findall(r"`(\w+)`", row.split("|")[1])}
    assert documented == arguments
