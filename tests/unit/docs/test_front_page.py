# SPDX-License-Identifier: BSD-3-Clause
"""The front page (README): its figures match the linked pages, and its citation matches the packages."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("row", re.findall(r"^\| .*\*\*.* \|$", (ROOT / "README.md").read_text(), re.MULTILINE))
def test_figures_of_the_front_page_are_those_of_the_linked_page(row: str) -> None:
    (link,) = re.findall(r"\]\(([\w./]+\.md)", row)
    page = (ROOT / link).read_text()
    assert not [figure for figure in re.findall(r"\*\*(.+?)\*\*", row) if figure not in page]


def test_citation_and_packages_have_the_same_version_and_licence() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    manifests = [ElementTree.parse(file) for file in (ROOT / "src").rglob("package.xml")]
    assert {manifest.findtext("version") for manifest in manifests} == {citation["version"]}
    assert f"version = {{{citation['version']}}}" in (ROOT / "README.md").read_text()
    assert citation["license"] == "BSD-3-Clause"
