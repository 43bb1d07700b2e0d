# SPDX-License-Identifier: BSD-3-Clause
"""Builds the documentation site, which needs no server: `./install.sh site`.

Sphinx needs all pages in a single folder. The program copies the Markdown pages of the repository to a source folder
without a change of their relative paths, so that links work on a forge and on the site. The program then adds:

- the navigation, from the lists of links in `docs/README.md`
- a page for each package of `public_modules.toml`, which Sphinx fills from the docstrings of the package
- a page that lists the READMEs of all packages

Sphinx warnings fail the build: broken links, pages outside the navigation, malformed docstrings.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import tomllib
from pathlib import Path

from sphinx.cmd.build import build_main

HERE = Path(__file__).resolve().parent
PAGES = ("README.md", "CHANGELOG.md", "docs/**/*.md", "src/*/README.md", "src/*/*/README.md")
FILES = ("docs/**/*.png", "docs/**/*.svg", "docs/**/*.webp", "docs/**/*.mp4", "CITATION.cff")
FRONT_PAGE = "docs/README"
PUBLIC_MODULES = "docs/site/public_modules.toml"
GENERATED_PAGES = {"Reference": ("/api/index", "/packages")}  # keyed by heading of the front page
PAGE_LINK = re.compile(r"^- \[[^\]]+\]\(([^)#\s]+)\.md\)", re.MULTILINE)
PACKAGE_KINDS = {
    "Framework": "src/modular_framework_*/README.md",
    "Methods": "src/methods/*/README.md",
    "Libraries for methods": "src/mbf_*/README.md",
    "Robots": "src/robots/*/README.md",
    "Packages under the names that others use": "src/compat/*/README.md",
}


def main(arguments: list[str]) -> int:
    """Builds the site and prints its address.

    Args:
        arguments: Command line without the program name.

    Returns:
        Exit code: 0 if Sphinx reported neither an error nor a warning.
    """
    parser = argparse.ArgumentParser(prog="./install.sh site", description="Builds the documentation as a web site.")
    parser.add_argument("--root", type=Path, default=HERE.parents[1], help="repository with the pages")
    parser.add_argument("--into", type=Path, help="folder of the site (default: build_site in the repository)")
    given = parser.parse_args(arguments)
    folder = (given.into or given.root / "build_site").resolve()
    source, html = folder / "source", folder / "html"
    for old in (source, html):
        shutil.rmtree(old, ignore_errors=True)
    write_sources(given.root.resolve(), source)
    options = ["-q", "-W", "--keep-going", "-E", "-j", "auto", "-d", str(folder / "doctrees"), "-c", str(HERE)]
    if code := build_main(["-b", "html", *options, str(source), str(html)]):
        print("site: Sphinx reported warnings; correct the pages that they name", file=sys.stderr)
        return code
    write_entrance(html)
    print(f"site: open {(html / 'index.html').as_uri()}")
    return 0


def write_sources(root: Path, source: Path) -> None:
    """Writes all pages of the site and the files that they show to the folder that Sphinx reads.

    Args:
        root: Repository with the pages.
        source: Folder to create.
    """
    for pattern in PAGES + FILES:
        for file in sorted(root.glob(pattern)):
            copy = source / file.relative_to(root)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, copy)
    front_page = source / f"{FRONT_PAGE}.md"
    front_page.write_text(front_page.read_text() + "".join(navigation(front_page.read_text())))
    (source / "packages.md").write_text(package_list(root))
    public_modules = root / PUBLIC_MODULES
    write_api_pages(root, source / "api", tomllib.loads(public_modules.read_text()) if public_modules.exists() else {})


def navigation(front_page: str) -> list[str]:
    """Returns a hidden table of contents for each section of the front page that links to pages.

    Args:
        front_page: Markdown text with a section per kind of page and a list item per page.
    """
    parts = re.split(r"^## (.+)$", front_page, flags=re.MULTILINE)
    tables = []
    for heading, section in zip(parts[1::2], parts[2::2], strict=True):
        pages = [*PAGE_LINK.findall(section), *GENERATED_PAGES.get(heading, ())]
        if pages:
            tables.append(table_of_contents(pages, "hidden", f"caption: {heading}", "titlesonly"))
    return tables


def table_of_contents(pages: list[str], *options: str) -> str:
    """Returns a directive that adds pages to the navigation.

    Args:
        pages: Page names without file extension, absolute or relative to the page with the directive.
        *options: Options of the directive `toctree`, without the leading colon.
    """
    fields = [f":{option}" if ": " in option else f":{option}:" for option in options]
    return "\n".join(["", "```{toctree}", *fields, "", *pages, "```", ""])


def package_list(root: Path) -> str:
    """Returns the page with the READMEs of all packages.

    Args:
        root: Repository with the packages.
    """
    text = "# Packages\n\nThe README of each package describes its purpose, its commands and its extension points.\n"
    for kind, pattern in PACKAGE_KINDS.items():
        pages = sorted(f"/{file.relative_to(root).with_suffix('')}" for file in root.glob(pattern))
        if pages:
            text += f"\n## {kind}\n" + table_of_contents(pages, "titlesonly")
    return text


def write_api_pages(root: Path, folder: Path, public_modules: dict[str, list[str]]) -> None:
    """Writes an API page per package, and the index of these pages.

    Args:
        root: Repository with the packages.
        folder: Folder to create.
        public_modules: Module names relative to their package, keyed by package.
    """
    folder.mkdir(parents=True)
    for package, modules in public_modules.items():
        (folder / f"{package}.md").write_text(api_page(root, package, modules))
    text = "# Python API\n\nPublic modules of each package, from their docstrings. All other modules are internal and"
    text += " change without notice.\n" + table_of_contents(list(public_modules), "titlesonly")
    (folder / "index.md").write_text(text)


def api_page(root: Path, package: str, modules: list[str]) -> str:
    """Returns the API page of a package; Sphinx fills its sections from the docstrings of the public modules.

    Args:
        root: Repository with the package.
        package: Name of the Python package and of its ROS package.
        modules: Module names relative to the package.
    """
    (readme,) = (file for pattern in PAGES for file in root.glob(pattern) if file.parent.name == package)
    text = f"# API of {package}\n\nStart with the [README of the package](../{readme.relative_to(root)}).\n"
    for module in modules:
        text += f"\n## {module}\n\n```{{eval-rst}}\n.. automodule:: {package}.{module}\n```\n"
    return text


def write_entrance(html: Path) -> None:
    """Writes a top-level page that redirects to the front page, which is in a subfolder.

    Args:
        html: Folder of the site.
    """
    address = f"{FRONT_PAGE}.html"
    (html / "index.html").write_text(
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>Modular Benchmarking Framework</title>'
        f'<meta http-equiv="refresh" content="0; url={address}"></head>'
        f'<body><a href="{address}">Documentation of the Modular Benchmarking Framework</a></body></html>\n'
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
