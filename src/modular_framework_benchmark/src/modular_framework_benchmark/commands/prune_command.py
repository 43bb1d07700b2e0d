# SPDX-License-Identifier: BSD-3-Clause
"""Command `prune`: deletes files of finished episodes, but no data of the database."""

from __future__ import annotations

import argparse
import shutil
import time
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from modular_framework_benchmark.commands.reporting import database_parser, run_reporting
from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.reports.report_source import open_experiment
from modular_framework_benchmark.scheduling.disk_guard import GB, tree_size

KINDS = {
    "bag": ("episode.bag", "bag.txt"),
    "video": ("video.mp4",),
    "log": ("log.txt",),
    "recording": (
        "trajectory.parquet",
        "tracking.parquet",
        "recording.json",
        "world.json",
        "parameters.json",
        "episode.json",
        "task_records",
    ),
}
"""Files of an episode, keyed by the values of `--files`."""
EVERYTHING = "all"
DAY_S = 86400.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Deletes files of episodes, or reports what would be deleted; returns 0, or 2 after an error."""
    return run_reporting(_parser(), arguments, _prune)


def _parser() -> argparse.ArgumentParser:
    parser = database_parser(
        "prune",
        "Deletes files of finished episodes. Their outcomes, metrics and spans stay in the database. Without --delete "
        "the command only reports what would be deleted.",
    )
    parser.add_argument(
        "--files",
        nargs="+",
        default=["bag", "video"],
        choices=[*KINDS, EVERYTHING],
        metavar="KIND",
        help=f"files to delete: {', '.join(KINDS)}, or {EVERYTHING}: whole folders; default: bag video",
    )
    parser.add_argument("--older-than", type=float, default=0.0, metavar="DAYS", help="only episodes older than this")
    parser.add_argument("--keep-failures", action="store_true", help="only successful episodes")
    parser.add_argument("--delete", action="store_true", help="delete the files")
    return parser


def _prune(arguments: argparse.Namespace) -> int:
    with open_experiment(arguments.database, arguments.experiment) as opened:
        root = opened.database.folder.resolve()
        episodes = opened.results.episodes
        name = opened.results.description.name
    chosen = episodes[(episodes["begun"] < time.time() - DAY_S * arguments.older_than) & (episodes["folder"] != "")]
    if arguments.keep_failures:
        chosen = chosen[chosen["status"] == EpisodeStatus.SUCCEEDED.value]
    paths = _paths_to_delete(chosen, root, arguments.files)
    size = sum(tree_size(path) if path.is_dir() else path.lstat().st_size for path in paths)
    for path in paths if arguments.delete else ():
        try:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        except OSError as error:
            raise ReportError(f"{path} cannot be deleted: {error.strerror}; earlier files are deleted") from error
    verb, hint = ("deleted", "") if arguments.delete else ("would be deleted", "; add --delete to delete them")
    print(f"{name}: {size / GB:.3g} GB in {len(paths)} files and folders of {len(chosen)} episodes {verb}{hint}")
    return 0


def _paths_to_delete(episodes: pd.DataFrame, root: Path, kinds: Sequence[str]) -> list[Path]:
    """Returns the paths to delete, restricted to the folder of the database."""
    paths = []
    for text in episodes["folder"]:
        folder = (root / str(text)).resolve()
        if root not in folder.parents or not folder.is_dir():
            continue
        if EVERYTHING in kinds:
            paths.append(folder)
        else:
            paths += [folder / name for kind in kinds for name in KINDS[kind] if (folder / name).exists()]
    return paths
