# SPDX-License-Identifier: BSD-3-Clause
"""The sources of the documentation site agree with the pages and the packages, without a build of the site."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[3]
KINDS = ("Tutorials", "How-to guides", "Reference", "Explanation")
PUBLIC_MODULES = {
    f"{package}.{module}"
    for package, modules in tomllib.loads((ROOT / "docs/site/public_modules.toml").read_text()).items()
    for module in modules
}
IMPORT = re.compile(r"^\s*from ((?:modular_framework_|[a-z_]+_grasps\.)[\w.]+) import", re.MULTILINE)


def sections_of(page: Path) -> dict[str, str]:
    parts = re.split(r"^## (.+)$", page.read_text(), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def modules_in_source() -> set[str]:
    """Names of the modules of all packages, from the paths SRC/PACKAGE/src/PACKAGE/..."""
    files = [file.relative_to(ROOT).with_suffix("") for file in (ROOT / "src").rglob("*.py")]
    inside = [file.parts[file.parts.index("src", 1) + 1 :] for file in files if "src" in file.parts[1:]]
    return {".".join(parts).removesuffix(".__init__") for parts in inside}


def test_each_page_is_in_the_list_of_exactly_one_kind() -> None:
    sections = sections_of(ROOT / "docs/README.md")
    assert tuple(sections) == KINDS
    listed = [link for text in sections.values() for link in re.findall(r"^- \[[^\]]+\]\(([\w/]+\.md)\)", text, re.M)]
    pages = [str(page.relative_to(ROOT / "docs")) for page in (ROOT / "docs").rglob("*.md")]
    assert sorted(listed) == sorted(set(pages) - {"README.md"})


def test_public_modules_exist() -> None:
    assert not PUBLIC_MODULES - modules_in_source()


def test_modules_that_pages_and_examples_import_are_public() -> None:
    files = [
        *(ROOT / "docs").rglob("*.md"),
        *(ROOT / "docs/examples").rglob("*.py"),
        *(ROOT / "src").rglob("README.md"),
    ]
    imported = {name for file in files for name in IMPORT.findall(file.read_text())}
    assert len(imported) > 10
    assert not imported - PUBLIC_MODULES
