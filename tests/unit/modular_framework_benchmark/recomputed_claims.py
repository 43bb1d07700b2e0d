# SPDX-License-Identifier: BSD-3-Clause
"""Recomputes from a result database what a report claims of it, with sqlite3, NumPy and SciPy's distributions alone.

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
from scipy import stats

STATUSES = ("succeeded", "failed", "timed_out", "broken", "invalid")


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


def score(episode: dict[str, Any], metric: dict[str, Any]) -> float | None:
    """Returns what an episode of the mode `task` counts in a comparison: a failure is worse than any value."""
    value = None if episode["status"] == "broken" else episode.get(metric["name"])
    succeeded = episode["status"] == "succeeded"
    if metric["name"] == "success":
        return float(succeeded)
    if metric["kind"] != "rate" and not succeeded and (metric["component"] == "task" or value is None):
        return math.inf if metric["better"] == "lower" else -math.inf
    return value


def exact_rate(successes: int, episodes: int, level: float = 0.95) -> tuple[float, float]:
    """Returns Clopper and Pearson's interval of a rate by the beta distribution."""
    error = (1 - level) / 2
    low = stats.beta.ppf(error, successes, episodes - successes + 1) if successes else 0.0
    return low, stats.beta.isf(error, successes + 1, episodes - successes) if successes < episodes else 1.0


def check_summary(claim: dict[str, Any], metric: dict[str, Any], episodes: list[dict[str, Any]]) -> None:
    """Checks the counts, the estimate, its interval, mean and quartiles of a method by a metric."""
    where = f"{claim['method']} {claim['metric']} {claim['levels']}"
    pairs = [counted_value(episode, metric) for episode in episodes]
    values = np.array([value for value, _ in pairs if value is not None])
    counts = claim["counts"]
    assert counts["episodes"] == len(episodes), where
    for status in STATUSES:
        assert counts[status] == sum(episode["status"] == status for episode in episodes), where
    scores = np.sort([found for episode in episodes if (found := score(episode, metric)) is not None])
    assert counts["counted"] == counts["units"] == len(scores), where  # every episode has a seed of its own here
    assert counts["censored"] == sum(censored for _, censored in pairs), where
    assert counts["missing"] == len(episodes) - len(scores), where
    if not len(scores):
        assert claim["estimate"] is None, where
        return
    interval = claim["estimate"]["interval"]
    if metric["kind"] == "rate":
        assert math.isclose(claim["estimate"]["value"], values.mean(), rel_tol=1e-9), where
        assert np.allclose((interval["low"], interval["high"]), exact_rate(int(values.sum()), len(values))), where
        return
    assert math.isclose(claim["mean"]["value"], values.mean(), rel_tol=1e-9), where
    assert np.allclose(claim["quartiles"], np.quantile(values, (0.25, 0.75))), where
    rank = next(rank for rank in range(len(scores)) if stats.binom.cdf(rank + 1, len(scores), 0.5) > 0.025)
    wanted = (np.median(scores), scores[rank], scores[-1 - rank])
    assert [finite(end) for end in wanted] == [claim["estimate"]["value"], interval["low"], interval["high"]], where


def finite(value: float) -> float | None:
    """Returns a number as JSON has it."""
    return float(value) if math.isfinite(value) else None


def check_comparison(
    claim: dict[str, Any], metric: dict[str, Any], episodes: list[dict[str, Any]], compared: str
) -> None:
    """Checks the pairs, the difference, its interval and the verdict of a comparison."""
    where = f"{claim['first']} {claim['second']} {claim['metric']}"
    others = [name for name in json.loads(episodes[0]["configuration"]) if name != compared]
    sides: list[dict[tuple[Any, ...], dict[str, Any]]] = [
        {
            (episode["trial"], *(episode[name] for name in others)): episode
            for episode in episodes
            if episode[compared] == method
        }
        for method in (claim["first"], claim["second"])
    ]
    pairs = [(sides[0][key], sides[1][key]) for key in sides[0] if key in sides[1]]
    scores = [tuple(score(episode, metric) for episode in pair) for pair in pairs]
    kept = [pair for pair in scores if None not in pair]
    counts = claim["counts"]
    assert (counts["pairs"], counts["missing"]) == (len(kept), len(pairs) - len(kept)), where
    if not kept:
        assert (claim["difference"], claim["verdict"]) == (None, "no_data"), where
        return
    higher, lower = (sum(bool(test(*pair)) for pair in kept) for test in (float.__gt__, float.__lt__))
    won, lost = (higher, lower) if metric["better"] == "higher" else (lower, higher)
    assert (counts["won"], counts["lost"], counts["units"]) == (won, lost, len(kept)), where
    assert math.isclose(claim["difference"]["value"], (won - lost) / len(kept), abs_tol=1e-12), where
    if metric["kind"] != "rate":
        both = [[counted_value(episode, metric)[0] for episode in pair] for pair in pairs]
        known = [one - two for one, two in both if one is not None and two is not None]
        assert math.isclose(claim["mean_difference"]["value"], np.mean(known), rel_tol=1e-9, abs_tol=1e-12), where
    p_value = stats.binomtest(won, won + lost).pvalue if won + lost else 1.0
    assert math.isclose(claim["p_value"], p_value, rel_tol=1e-6, abs_tol=1e-12), where
    check_verdict(claim, won, lost, where)


def check_verdict(claim: dict[str, Any], won: int, lost: int, where: str) -> None:
    """Checks that a difference is claimed only where the corrected p value and the interval both show it."""
    interval = claim["difference"]["interval"]
    assert interval["low"] <= claim["difference"]["value"] <= interval["high"], where
    shown = claim["p_corrected"] <= 0.05 and (interval["low"] > 0 or interval["high"] < 0)
    assert claim["verdict"] == (("first_better" if won > lost else "second_better") if shown else "not_shown"), where
    assert claim["p_value"] <= claim["p_corrected"] <= 1.0, where
    better = claim["first"] if won > lost else claim["second"]
    assert ("no difference" in claim["sentence"]) is not shown, where
    assert not shown or claim["sentence"].startswith(better), where


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
