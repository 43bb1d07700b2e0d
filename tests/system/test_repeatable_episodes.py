# SPDX-License-Identifier: BSD-3-Clause
"""One seed gives the same pick bit for bit, after a cold start as after another episode in the same launch."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmarks" / "repeatability"
TIMEOUT_S = 600.0


def test_a_seeded_pick_is_the_same_after_a_warm_restart(tmp_path: Path) -> None:
    figures = tmp_path / "figures.json"
    run = subprocess.run(
        [sys.executable, str(BENCHMARK), "--quick", "--json", str(figures), "--keep-logs", str(tmp_path / "logs")],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    logs = "".join(path.read_text()[-6000:] for path in (tmp_path / "logs").glob("*.txt"))
    assert figures.exists(), run.stdout + run.stderr + logs
    (row,) = json.loads(figures.read_text())["rows"]
    assert row["outcome"] == "successful_pipeline", run.stdout + logs
    assert row["equal"], run.stdout + logs
