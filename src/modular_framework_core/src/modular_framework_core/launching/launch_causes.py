# SPDX-License-Identifier: BSD-3-Clause
"""Finds the reason for the end of a node in its log file."""

from __future__ import annotations

import re
from pathlib import Path

_RECORD = re.compile(r"^\[[\w.]+\]\[(\w+)\] [\d-]+ [\d:,]+: ")


def cause_of_death(log_file: Path) -> str:
    """Returns the last fatal message in a log file of rospy, or "" without a message or file."""
    try:
        lines = log_file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    message: list[str] = []
    in_fatal = False
    for line in lines:
        record = _RECORD.match(line)
        if record is not None:
            in_fatal = record[1] == "CRITICAL"
            if in_fatal:
                message = []
        if in_fatal:
            message.append(line[record.end() :] if record is not None else line)
    return "\n".join(message).strip()
