# SPDX-License-Identifier: BSD-3-Clause
"""Recomputes from a result database what a report claims of it, with sqlite3 and NumPy alone.

It imports nothing of the product, so that no fault of its statistics can hide in its tests. Run it on a report:
`python3 recomputed_claims.py DATABASE REPORT.html`.
"""

from __future__ import annotations

import json
import math
import re
import sqlite3
import sys
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

STATUSES = ("succeeded", "failed", "timed_out", "broken")
NORMAL_975 = 1.959963984540054


def claims_of(page: str) -> dict[str, Any]:
    """Returns the claims that a page carries as JSON."""
    found = re.search(r'<script type="application/json" id="report-data">(.*?)</script>', page, re.DOTALL)
    assert found, "the page carries no element report-data"
    return json.loads(found.group(1))


def read_episodes(database: Path, experiment: str) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Returns the description of an experiment and a row for each finished episode."""
    connection = sqlite3.connect(f"file:{database}?mode=ro", uri=True)
    connection.row_factory = sqlite3.Row
    number, content = connection.execute(
        "SELECT id, content FROM descriptions WHERE name = ?", (experiment,)
    ).fetchone()
    names = {
        row["value"]: row["description"] for row in connection.execute("SELECT * FROM enums WHERE name = 'status'")
    }
    rows = connection.execute(
        "SELECT episodes.number, episodes.trial, episodes.configuration, runs.*, records.cause, runs.id AS run "
        "FROM episodes JOIN runs ON runs.id = episodes.id JOIN records ON records.runid = runs.id "
        "WHERE episodes.descriptionid = ? ORDER BY episodes.number",
        (number,),
    ).fetchall()
    episodes = [{**dict(row), **json.loads(row["configuration"]), "status": names[row["status"]]} for row in rows]
    for episode in episodes:
        episode["spans"] = []
    by_run = {episode["run"]: episode for episode in episodes}
    for span in connection.execute("SELECT * FROM spans"):
        if span["runid"] in by_run:
            by_run[span["runid"]]["spans"].append(dict(span))
    connection.close()
    return json.loads(content), episodes


def counted_value(episode: dict[str, Any], metric: dict[str, Any]) -> tuple[float | None, bool]:
    """Returns what an episode of the mode `task` counts in a metric, and whether that is at the metric's limit."""
    succeeded = episode["status"] == "succeeded"
    if metric["name"] == "success":
        return float(succeeded), False
    value = None if episode["status"] == "broken" else episode[metric["name"]]
    limit = metric["limit"]
    if limit is None:
        return value, False
    if value is None:
        return (None, False) if succeeded else (limit, True)
    beyond = value >= limit if metric["better"] == "lower" else value <= limit
    if beyond or (metric["component"] == "task" and not succeeded):
        return limit, True
    return value, False


def wilson(successes: int, episodes: int) -> tuple[float, float]:
    """Returns the 95 % interval of a rate. Source: E. B. Wilson, J. American Statistical Association, 1927."""
    z, share = NORMAL_975, successes / episodes
    middle = (share + z * z / (2 * episodes)) / (1 + z * z / episodes)
    half = z / (1 + z * z / episodes) * math.sqrt(share * (1 - share) / episodes + z * z / (4 * episodes * episodes))
    return middle - half, middle + half


def check_summary(claim: dict[str, Any], metric: dict[str, Any], episodes: list[dict[str, Any]]) -> None:
    """Checks the counts, the estimate, its interval, median and quartiles of a method by a metric."""
    where = f"{claim['method']} {claim['metric']} {claim['levels']}"
    pairs = [counted_value(episode, metric) for episode in episodes]
    values = np.array([value for value, _ in pairs if value is not None])
    counts = claim["counts"]
    assert counts["episodes"] == len(episodes), where
    for status in STATUSES:
        assert counts[status] == sum(episode["status"] == status for episode in episodes), where
    assert counts["counted"] == len(values), where
    assert counts["censored"] == sum(censored for _, censored in pairs), where
    assert counts["missing"] == len(episodes) - len(values), where
    if not len(values):
        assert claim["estimate"] is None, where
        return
    estimate, interval = claim["estimate"], claim["estimate"]["interval"]
    assert math.isclose(estimate["value"], values.mean(), rel_tol=1e-9), where
    if metric["kind"] == "rate":
        assert np.allclose((interval["low"], interval["high"]), wilson(int(values.sum()), len(values))), where
        return
    assert math.isclose(claim["median"], np.median(values), rel_tol=1e-9), where
    assert np.allclose(claim["quartiles"], np.quantile(values, (0.25, 0.75))), where
    check_interval(interval, values, where)


def check_interval(interval: dict[str, Any], values: np.ndarray, where: str) -> None:
    """Checks the interval of a mean against that of the normal distribution, which skewed values may make wider."""
    if not np.ptp(values):
        assert interval["low"] == interval["high"] == values[0], where
        return
    half = NORMAL_975 * values.std(ddof=1) / math.sqrt(len(values))
    assert interval["low"] < values.mean() < interval["high"], where
    if len(values) >= 50:
        assert 0.8 < (interval["high"] - interval["low"]) / (2 * half) < 1.8, where


def check_comparison(
    claim: dict[str, Any], metric: dict[str, Any], episodes: list[dict[str, Any]], compared: str
) -> None:
    """Checks the pairs, the difference, its interval and the verdict of a comparison."""
    where = f"{claim['first']} {claim['second']} {claim['metric']}"
    others = [name for name in json.loads(episodes[0]["configuration"]) if name != compared]
    sides: list[dict[tuple[Any, ...], float | None]] = [
        {
            (episode["trial"], *(episode[name] for name in others)): counted_value(episode, metric)[0]
            for episode in episodes
            if episode[compared] == method
        }
        for method in (claim["first"], claim["second"])
    ]
    common = [key for key in sides[0] if key in sides[1]]
    pairs = [(sides[0][key], sides[1][key]) for key in common]
    kept = np.array([(one, two) for one, two in pairs if one is not None and two is not None])
    assert claim["counts"]["pairs"] == len(kept), where
    assert claim["counts"]["missing"] == len(pairs) - len(kept), where
    if not len(kept):
        assert claim["difference"] is None, where
        assert claim["verdict"] == "no_data", where
        return
    differences = kept[:, 0] - kept[:, 1]
    assert math.isclose(claim["difference"]["value"], differences.mean(), rel_tol=1e-9, abs_tol=1e-12), where
    interval = claim["difference"]["interval"]
    assert interval["low"] <= differences.mean() <= interval["high"], where
    half = NORMAL_975 * differences.std(ddof=1) / math.sqrt(len(differences))
    if len(differences) >= 50:
        assert 0.75 < (interval["high"] - interval["low"]) / (2 * half) < 1.8, where
    check_verdict(claim, metric, interval, where)


def check_verdict(claim: dict[str, Any], metric: dict[str, Any], interval: dict[str, Any], where: str) -> None:
    """Checks that a difference is claimed only where the corrected p value and the interval both show it."""
    shown = claim["p_corrected"] <= 0.05 and (interval["low"] > 0 or interval["high"] < 0)
    higher = claim["difference"]["value"] > 0
    first_better = higher == (metric["better"] == "higher")
    assert claim["verdict"] == (("first_better" if first_better else "second_better") if shown else "not_shown"), where
    assert claim["p_value"] <= claim["p_corrected"] <= 1.0, where
    shown_better = claim["first"] if first_better else claim["second"]
    assert ("no difference" in claim["sentence"]) is not shown, where
    assert not shown or claim["sentence"].startswith(shown_better), where


def check_failures(claims: dict[str, Any], episodes: list[dict[str, Any]], compared: str) -> None:
    """Checks the failures by cause, causes that differ in numbers alone taken as one."""
    failed = sorted(
        (
            episode["status"],
            re.sub(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?!\w)", "…", episode["cause"]),
            episode[compared],
        )
        for episode in episodes
        if episode["status"] != "succeeded"
    )
    groups = {key: list(rows) for key, rows in groupby(failed, key=lambda row: row[:2])}
    assert claims["failures"]["episodes"] == len(failed)
    assert claims["failures"]["causes"] == len(groups)
    assert [group["episodes"] for group in claims["failures"]["groups"]] == sorted(
        map(len, groups.values()), reverse=True
    )[:40]
    for group in claims["failures"]["groups"]:
        assert sum(group["by_method"].values()) == group["episodes"]


def check_spans(claims: dict[str, Any], episodes: list[dict[str, Any]], compared: str) -> None:
    """Checks what states and components took."""
    for claim in claims["spans"]:
        of_method = [episode for episode in episodes if episode[compared] == claim["method"]]
        spans = [
            span for episode in of_method for span in episode["spans"]
            if (span["kind"], span["name"]) == (claim["kind"], claim["name"])
        ]  # fmt: skip
        lengths = [span["ended_s"] - span["started_s"] for span in spans if span["ended_s"] is not None]
        assert claim["runs"] == len(spans)
        assert claim["failed"] == sum(span["failed"] for span in spans)
        assert claim["unended"] == len(spans) - len(lengths)
        assert math.isclose(claim["per_episode_s"], sum(lengths) / len(of_method), rel_tol=1e-9)
        assert claim["mean_s"] is None if not lengths else math.isclose(claim["mean_s"], np.mean(lengths), rel_tol=1e-9)


def check_report(database: Path, page: str) -> int:
    """Checks every claim of a report; returns how many there were.

    Raises:
        AssertionError: a claim does not hold.
    """
    claims = claims_of(page)
    description, episodes = read_episodes(database, claims["experiment"])
    compared = description["compared"]
    metrics = {metric["name"]: metric for metric in description["metrics"]}
    assert claims["finished"] == len(episodes)
    summaries = [*claims["analysis"]["summaries"], *claims["levels"]]
    for claim in summaries:
        factor, _, level = claim["levels"].partition("=")
        chosen = [
            episode for episode in episodes
            if episode[compared] == claim["method"] and (not factor or episode[factor] == level)
        ]  # fmt: skip
        check_summary(claim, metrics[claim["metric"]], chosen)
    for claim in claims["analysis"]["comparisons"]:
        check_comparison(claim, metrics[claim["metric"]], episodes, compared)
    check_failures(claims, episodes, compared)
    check_spans(claims, episodes, compared)
    return len(summaries) + len(claims["analysis"]["comparisons"]) + len(claims["spans"])


if __name__ == "__main__":
    checked = check_report(Path(sys.argv[1]), Path(sys.argv[2]).read_text(encoding="utf-8"))
    print(f"{checked} claims hold")
