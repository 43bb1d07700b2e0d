# SPDX-License-Identifier: BSD-3-Clause
"""Commands `run_experiment` and `resume`."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import rospkg

from modular_framework_benchmark.commands.experiment_session import ExperimentSession, SessionOptions
from modular_framework_benchmark.commands.mode_runners import RunnerError, known_metrics, setting_checks
from modular_framework_benchmark.experiments.design import design_text, digest_of, plan_episodes
from modular_framework_benchmark.experiments.experiment import Experiment
from modular_framework_benchmark.experiments.experiment_file import load_experiment
from modular_framework_benchmark.experiments.reading import ExperimentFault
from modular_framework_benchmark.experiments.resource_lookup import DEFAULT_LAUNCH
from modular_framework_benchmark.modes.ros_disk_estimate import disk_text
from modular_framework_benchmark.modes.ros_run_digests import run_digests
from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.episode_settings import SettingsError
from modular_framework_benchmark.results.connection import shown_target
from modular_framework_benchmark.results.database import ResultDatabase, open_database
from modular_framework_benchmark.results.errors import RecordNotStoredError, ResultsError
from modular_framework_benchmark.scheduling.local_pool import SchedulerError
from modular_framework_benchmark.scheduling.run_lock import RunLock, RunLockError
from modular_framework_benchmark.scheduling.worker_process import WorkerStartError
from modular_framework_core.files.default_folders import API_PACKAGE

EXIT_USER_ERROR, EXIT_FAILED, EXIT_INTERRUPTED = 2, 1, 130
USER_ERRORS = (ExperimentFault, ResultsError, RunLockError, RunnerError, SchedulerError, SettingsError)


class CommandError(Exception):
    """The command cannot be executed."""


def run_experiment(arguments: Sequence[str]) -> int:
    """Runs the command `run_experiment`."""
    parser = argparse.ArgumentParser(
        prog="run_experiment", description="Runs an experiment file, or continues an interrupted run."
    )
    parser.add_argument("file", type=Path, help=f"experiment file, or its name in {API_PACKAGE}/experiments")
    parser.add_argument("--database", help="SQLite file or SQLAlchemy URL for the results; default: EXPERIMENT.db here")
    parser.add_argument("--dry-run", action="store_true", help="check the file and list its episodes without running")
    parser.add_argument(
        "--robot", metavar="PACKAGE", help="use the start_framework.launch of this package in the mode task"
    )
    _add_run_options(parser)
    return _run_guarded_command(_run, parser.parse_args(arguments))


def resume(arguments: Sequence[str]) -> int:
    """Runs the command `resume`."""
    parser = argparse.ArgumentParser(prog="resume", description="Continues an interrupted experiment.")
    parser.add_argument("database", help="SQLite file or SQLAlchemy URL with its results")
    parser.add_argument("--experiment", help="name of the experiment; default: the only unfinished experiment")
    _add_run_options(parser)
    return _run_guarded_command(_resume, parser.parse_args(arguments))


def _add_run_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--workers", type=int, help="number of parallel episodes; default: from the file")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="run on the workers of this Dask scheduler")
    parser.add_argument(
        "--disk-limit", type=float, default=math.inf, metavar="GB", help="end cleanly before the files exceed this size"
    )
    parser.add_argument(
        "--runner", default="", metavar="MODULE:NAME", help="factory of the runner; default: from the mode"
    )


def _run_guarded_command(command: Callable[[argparse.Namespace], int], options: argparse.Namespace) -> int:
    """Runs a command; converts errors to messages and exit codes."""
    try:
        if options.workers is not None and options.workers < 1:
            raise CommandError(f"--workers is {options.workers}; allowed: 1 or more")
        if not options.disk_limit > 0.0:
            raise CommandError(f"--disk-limit is {options.disk_limit:g}; allowed: more than 0 [GB]")
        return command(options)
    except (RecordNotStoredError, WorkerStartError) as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_FAILED
    except (*USER_ERRORS, CommandError) as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_USER_ERROR
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        return EXIT_INTERRUPTED


def _run(options: argparse.Namespace) -> int:
    # Imported here, because `resume` does not need roslaunch.
    from modular_framework_benchmark.experiments.ros_resource_lookup import RosResourceLookup

    launch = DEFAULT_LAUNCH.replace(API_PACKAGE, options.robot) if options.robot else ""
    file = experiment_path(options.file)
    experiment = load_experiment(file, RosResourceLookup(), known_metrics(), setting_checks(), launch)
    episodes = plan_episodes(experiment)
    if options.dry_run:
        from modular_framework_benchmark.statistics.planned_power import power_text  # slow to import

        print(design_text(experiment, episodes))
        print(disk_text(episodes))
        print(power_text(experiment.description, episodes))
        return 0
    target = options.database or f"{experiment.description.name}.db"
    return run_episodes(experiment, episodes, _session_options(options, target))


def run_episodes(experiment: Experiment, episodes: Sequence[EpisodeSpec], options: SessionOptions) -> int:
    """Runs the episodes that the database lacks; returns the exit code.

    Args:
        experiment: Experiment of the episodes.
        episodes: Episodes from `plan_episodes`, or some of them.
        options: Options of the run.

    Raises:
        Exception: One of `USER_ERRORS`; a failed episode is not an error.
        RecordNotStoredError: The database is not writable.
        WorkerStartError: A worker cannot be started.
    """
    with RunLock(options.target) as lock, open_database(options.target, create=True) as database:
        ran_with = run_digests(episodes)
        number = database.add_experiment(experiment.describe(digest_of(experiment, episodes), ran_with), episodes)
        return _make_session(database, number, lock, options).run()


def _resume(options: argparse.Namespace) -> int:
    with RunLock(options.database) as lock, open_database(options.database) as database:
        number = _find_unfinished_experiment(database, options.experiment, options.database)
        database.check_resumed(number, run_digests(database.pending(number)))
        return _make_session(database, number, lock, _session_options(options, options.database)).run()


def _session_options(options: argparse.Namespace, target: str) -> SessionOptions:
    return SessionOptions(target, options.workers, options.scheduler, options.runner, options.disk_limit)


def _make_session(database: ResultDatabase, number: int, lock: RunLock, options: SessionOptions) -> ExperimentSession:
    if lock.ended_processes:
        print(f"ended {lock.ended_processes} processes of an earlier run", file=sys.stderr)
    return ExperimentSession(database, number, lock.run, options)


def _find_unfinished_experiment(database: ResultDatabase, name: str | None, target: str) -> int:
    """Returns the identifier of the experiment to continue."""
    if name is not None:
        return database.find(name)
    stored = database.experiments()
    unfinished = [experiment for experiment in stored if experiment.finished < experiment.planned]
    if len(unfinished) == 1:
        return unfinished[0].id
    if len(stored) == 1:
        return stored[0].id
    names = ", ".join(experiment.description.name for experiment in unfinished or stored)
    count = f"{len(unfinished)} unfinished experiments" if unfinished else "no unfinished experiment"
    shown = shown_target(target)
    raise CommandError(
        f"{shown} has {count}; name an experiment with --experiment; allowed: {names or 'none, it is empty'}"
    )


def experiment_path(path_argument: Path) -> Path:
    """Returns the path of an experiment file: as given, or in the API package for a bare name."""
    if path_argument.exists() or path_argument.name != str(path_argument):
        return path_argument
    try:
        folder = Path(rospkg.RosPack().get_path(API_PACKAGE)) / "experiments"
    except rospkg.ResourceNotFound:
        return path_argument
    shipped = [folder / path_argument.name, folder / f"{path_argument.name}.yaml"]
    return next((path for path in shipped if path.is_file()), path_argument)
