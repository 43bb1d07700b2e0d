# SPDX-License-Identifier: BSD-3-Clause
"""The documentation site: a single command builds all pages, and a fault in a page fails the build."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BUILDER = ROOT / ".venv/site_builder"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Builds the site with the command."""
    folder = tmp_path_factory.mktemp("site")
    subprocess.run([ROOT / "install.sh", "site", "--into", folder], check=True, timeout=600)
    return folder / "html"


def build(root: Path) -> subprocess.CompletedProcess[str]:
    """Builds a site from the pages of a different folder, without the API."""
    env = {**os.environ, "PYTHONPATH": f"{BUILDER}:{os.environ.get('PYTHONPATH', '')}"}
    command = [sys.executable, ROOT / "docs/site/build_site.py", "--root", root]
    return subprocess.run(command, env=env, capture_output=True, text=True, timeout=300, check=False)


def test_the_site_leads_to_every_page_and_to_the_api_of_every_package(site: Path) -> None:
    assert "docs/README.html" in (site / "index.html").read_text()
    pages = [page.relative_to(ROOT) for page in (ROOT / "docs").rglob("*.md")]
    assert not [page for page in pages if not (site / page.with_suffix(".html")).exists()]
    packages = tomllib.loads((ROOT / "docs/site/public_modules.toml").read_text())
    assert not [package for package in packages if not (site / f"api/{package}.html").exists()]


def test_a_public_class_has_its_docstring_on_the_page_and_its_name_in_the_index_of_the_search(site: Path) -> None:
    assert "A state whose first outcome is positive" in (site / "api/modular_framework_core.html").read_text()
    assert "FrameworkState" in (site / "searchindex.js").read_text()


@pytest.mark.parametrize(
    "fault, message",
    [
        ("broken link", "no_such_page.md"),
        ("broken anchor", "no-such-heading"),
        ("page outside the navigation", "lonely.md"),
        ("no fault", ""),
    ],
)
def test_a_fault_in_a_page_fails_the_build_and_is_named(site: Path, tmp_path: Path, fault: str, message: str) -> None:
    for name in ("README.md", "CHANGELOG.md"):
        (tmp_path / name).write_text("# Title\n")
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs/README.md").write_text(
        "# Pages\n\n## Reference\n\n- [A](../README.md)\n- [B](../CHANGELOG.md)\n- [C](page.md)\n"
    )
    page = tmp_path / "docs/page.md"
    page.write_text("# Page\n\n[overview](../README.md)\n")
    match fault:
        case "broken link":
            page.write_text("# Page\n\n[link](no_such_page.md)\n")
        case "broken anchor":
            page.write_text("# Page\n\n[link](README.md#no-such-heading)\n")
        case "page outside the navigation":
            shutil.copy(page, tmp_path / "docs/lonely.md")
    answer = build(tmp_path)
    assert (answer.returncode == 0) == (not message), answer.stderr
    assert message in answer.stderr
