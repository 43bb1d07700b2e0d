# SPDX-License-Identifier: BSD-3-Clause
"""The claims of a report hold when they are recomputed from the database, and a wrong one is found."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import pytest
import recomputed_claims
from report_pages import Page
from reported_experiment import ReportedExperiment


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Page]:
    """A database and the page of its report."""
    folder = tmp_path_factory.mktemp("claims")
    database = ReportedExperiment(trials=30, with_files=False).store(folder / "results.db")
    return database, Page.of(database, folder / "report.html")


def test_every_claim_holds_when_it_is_recomputed(reported: tuple[Path, Page]) -> None:
    database, page = reported
    assert recomputed_claims.check_report(database, page.text) == 7 * 3 + 2 * 3 + 7 * 3 + 10 * 3


def test_the_recomputation_imports_nothing_of_the_product() -> None:
    tree = ast.parse(Path(recomputed_claims.__file__).read_text(encoding="utf-8"))
    imported = {
        name.partition(".")[0]
        for node in ast.walk(tree)
        for name in (
            [alias.name for alias in node.names] if isinstance(node, ast.Import)
            else [str(node.module)] if isinstance(node, ast.ImportFrom)
            else []
        )
    }  # fmt: skip
    assert not [name for name in imported if name.startswith("modular_framework")]


@pytest.mark.parametrize(
    "path",
    [
        ("analysis", "summaries", 0, "estimate", "value"),
        ("analysis", "summaries", 0, "estimate", "interval", "low"),
        ("analysis", "summaries", 3, "counts", "censored"),
        ("analysis", "summaries", 4, "mean", "value"),
        ("analysis", "comparisons", 0, "difference", "value"),
        ("analysis", "comparisons", 0, "counts", "pairs"),
        ("analysis", "comparisons", 3, "counts", "won"),
        ("analysis", "comparisons", 3, "p_value"),
        ("levels", 1, "estimate", "value"),
        ("failures", "episodes"),
        ("spans", 2, "per_episode_s"),
    ],
    ids=lambda path: ".".join(map(str, path)),
)
def test_a_wrong_claim_is_found(reported: tuple[Path, Page], path: tuple[str | int, ...]) -> None:
    database, page = reported
    claims = page.claims
    holder = claims
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] += 1 if isinstance(holder[path[-1]], int) else 0.01
    changed = json.dumps(claims).replace("<", "\\u003c")
    with pytest.raises(AssertionError):
        recomputed_claims.check_report(database, f'<script type="application/json" id="report-data">{changed}</script>')


def test_the_tables_show_the_numbers_of_the_claims(reported: tuple[Path, Page]) -> None:
    _, page = reported
    shown = [float(cell.split(" ")[0]) for row in page.rows("overview")[:1] for cell in row[1:4]]
    claimed = [100 * item["estimate"]["value"] for item in page.claims["analysis"]["summaries"][:3]]
    assert shown == pytest.approx(claimed, abs=0.6)
