# SPDX-License-Identifier: BSD-3-Clause
"""Results of checks, and the texts that the command `doctor` prints and writes for an issue report."""

from __future__ import annotations

import enum
import getpass
import re
import socket
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

WIDTH = 120
LABEL_WIDTH = 7
PAGE = "docs/troubleshooting.md"


class Level(enum.Enum):
    """Importance of a finding."""

    OK = "ok"
    NOTE = "note"
    FAULT = "FAULT"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Result of a check.

    Attributes:
        level: Importance; a fault prevents the framework from working.
        text: What was found.
        remedy: What to do; empty for nothing.
        anchor: Section of the page on troubleshooting; empty for none.
    """

    level: Level
    text: str
    remedy: str = ""
    anchor: str = ""

    def lines(self) -> list[str]:
        """Returns the finding as lines of at most `WIDTH` characters."""
        indent = " " * (LABEL_WIDTH + 2)
        texts = [self.text]
        if self.remedy:
            texts.append(f"What to do: {self.remedy}")
        if self.anchor:
            texts.append(f"See {PAGE}#{self.anchor}")
        lines = []
        for text in texts:
            lines += textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False)
        return [f"  {self.level.value:<{LABEL_WIDTH}}{lines[0].lstrip()}", *lines[1:]]


def ok(text: str) -> Finding:
    """Returns the finding of a check without a fault."""
    return Finding(level=Level.OK, text=text)


def note(text: str, remedy: str = "", anchor: str = "") -> Finding:
    """Returns a finding that a user may want to know.

    Args:
        text: What was found.
        remedy: What to do; empty for nothing.
        anchor: Section of the page on troubleshooting; empty for none.
    """
    return Finding(level=Level.NOTE, text=text, remedy=remedy, anchor=anchor)


def fault(text: str, remedy: str, anchor: str) -> Finding:
    """Returns a finding that prevents the framework from working.

    Args:
        text: What was found.
        remedy: What to do.
        anchor: Section of the page on troubleshooting.
    """
    return Finding(level=Level.FAULT, text=text, remedy=remedy, anchor=anchor)


@dataclass(frozen=True, slots=True)
class Section:
    """Findings about one subject, with a title."""

    title: str
    findings: Sequence[Finding]


def has_faults(sections: Sequence[Section]) -> bool:
    """Returns whether a section contains a fault."""
    return any(finding.level is Level.FAULT for section in sections for finding in section.findings)


def section_text(section: Section) -> str:
    """Returns a section as text, with its title in the first line."""
    return "\n".join([section.title, *(line for finding in section.findings for line in finding.lines())])


def without_private_data(text: str) -> str:
    """Returns a text without the names of user and host, the home folder, and addresses of other computers."""
    home, user, host = str(Path.home()), getpass.getuser(), socket.gethostname()
    text = text.replace(home, "~") if home != "/" else text
    for name, replacement in ((user, "USER"), (host, "HOST")):
        text = re.sub(rf"(?<![\w-]){re.escape(name)}(?![\w-])", replacement, text)
    return re.sub(r"\b(?!127\.|0\.0\.0\.0)\d{1,3}(\.\d{1,3}){3}\b", "ADDRESS", text)
