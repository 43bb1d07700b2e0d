# SPDX-License-Identifier: BSD-3-Clause
"""Makes reports with the commands, and reads their pages."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from lxml import html
from recomputed_claims import claims_of

from modular_framework_benchmark.commands.report_command import main

CHROMIUM = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--host-resolver-rules=MAP * ~NOTFOUND",
    "--virtual-time-budget=60000",
)  # fmt: skip


@dataclass(frozen=True)
class Page:
    """The page of a report.

    Attributes:
        path: Its file.
        text: Its HTML.
    """

    path: Path
    text: str

    @classmethod
    def of(cls, database: Path, into: Path) -> Page:
        """Reports a database with the command."""
        assert main([str(database), "--into", str(into)]) == 0
        return cls(into, into.read_text(encoding="utf-8"))

    @property
    def tree(self) -> html.HtmlElement:
        """The page as a tree of elements."""
        return html.document_fromstring(self.text)

    @property
    def claims(self) -> dict[str, Any]:
        """What the page carries for programs."""
        return claims_of(self.text)

    @property
    def words(self) -> str:
        """The text that a reader sees, in one line."""
        body = self.tree.body
        for hidden in body.xpath("//script | //style"):
            hidden.drop_tree()
        return " ".join(body.text_content().split())

    def figures(self) -> dict[str, Any]:
        """The figures that the page draws, as Plotly reads them."""
        return json.loads(self.tree.get_element_by_id("report-figures").text_content())

    def rows(self, table: str) -> list[list[str]]:
        """The texts of the cells of a table, row by row, the heading of a group in its first row only."""
        body = self.tree.get_element_by_id(f"table-{table}")
        return [[cell.text_content().strip() for cell in row] for row in body.xpath("./tbody/tr")]


class Loads(HTMLParser):
    """Collects what a browser would load to show a page: the addresses of scripts, styles, images and frames."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        loaded = {"src", "srcset", "data", "poster", "background"} | ({"href"} if tag in ("link", "base") else set())
        self.addresses += [value or "" for name, value in attrs if name in loaded]


def drawn_page(page: Path, folder: Path) -> str:
    """Returns the page as headless Chromium has it after its scripts ran, without a network."""
    chromium = shutil.which("chromium")
    assert chromium, "install the package chromium of packages-debian.txt"
    command = [chromium, *CHROMIUM, f"--user-data-dir={folder / 'profile'}", "--dump-dom", page.as_uri()]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=180, check=True, env={**os.environ, "HOME": str(folder)}
    )
    return done.stdout
