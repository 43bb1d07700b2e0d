# SPDX-License-Identifier: BSD-3-Clause
"""`compare` marks what two runs ran with that is not the same; a report warns of load, faults and killed tries."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from sample_experiment import sample_description, sample_episodes, sample_record

from modular_framework_benchmark.commands.compare_command import main as compare
from modular_framework_benchmark.commands.report_command import main as report
from modular_framework_benchmark.episodes.snapshot import RUN_ID_VARIABLE, MachineLoad, reference_s
from modular_framework_benchmark.experiments.grasps_mode import GraspSettings
from modular_framework_benchmark.experiments.kinematics_mode import KinematicsSettings
from modular_framework_benchmark.experiments.planning_mode import PlanningSettings
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.metrics.measurements import ComponentReport
from modular_framework_benchmark.modes.measured_record import Stopwatch, measured_record
from modular_framework_benchmark.records.episode import EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.records.episode_settings import EpisodeSettings
from modular_framework_benchmark.records.experiment import Factor
from modular_framework_benchmark.records.level_digests import combination_key, digests_text
from modular_framework_benchmark.records.used_software import UsedSoftware
from modular_framework_benchmark.reports.report_source import open_source
from modular_framework_benchmark.reports.run_record import warnings_of
from modular_framework_benchmark.results.database import open_database
from modular_framework_ros.reported_figures import Clock

PLANNERS = {"RRTConnect of ompl": {"range": 0.1, "implementation": "compiled"}}
SNAPSHOT: dict[str, Any] = {
    "packages": {"numpy": "2.4"},
    "planners": PLANNERS,
    "methods": {"top_down_grasps": {"version": "0.1.0", "sources": "aa"}},
    "machine": {"host": "lab-1"},
    "reference_s": 0.1,
    "load_before": 0.5,
}


def stored(path: Path, others_shares: Sequence[float] = (), **changes: Any) -> str:
    """Stores an experiment of 8 episodes whose snapshots have the changes, and each its own load by others."""
    description = sample_description()
    metrics = tuple(
        replace(each, clock=Clock.WALL) if each.name == "planning_time" else each for each in description.metrics
    )
    episodes = sample_episodes(2)
    with open_database(path, create=True) as database:
        number = database.add_experiment(replace(description, metrics=metrics), episodes)
        for spec in episodes:
            load = {"others_share": others_shares[spec.number]} if others_shares else {}
            database.write(number, sample_record(spec, snapshot={**SNAPSHOT, **changes, **load}))
    return str(path)


def page_text(path: str) -> str:
    page = Path(path).with_suffix(".html")
    assert report([path, "--into", str(page)]) == 0
    return page.read_text()


def warnings(path: str) -> str:
    with open_source(path, None) as opened:
        return " ".join(warnings_of(opened.results, opened.snapshots, opened.combinations))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"packages": {"numpy": "2.5"}}, "packages.numpy: before 2.4; after 2.5"),
        (
            {"planners": {"RRTConnect of ompl": {"range": 0.2, "implementation": "compiled"}}},
            "planners.RRTConnect of ompl.range: before 0.1; after 0.2",
        ),
        (
            {"planners": {"RRTConnect of ompl": {"range": 0.1, "implementation": "OMPL"}}},
            "planners.RRTConnect of ompl.implementation: before compiled; after OMPL",
        ),
        (
            {"methods": {"top_down_grasps": {"version": "0.1.0", "sources": "bb"}}},
            "methods.top_down_grasps.sources: before aa; after bb",
        ),
        (
            {"machine": {"host": "lab-2"}, "reference_s": 0.15},
            "the reference workload takes 0.100 s before and 0.150 s after (1.50 times)",
        ),
    ],
)
def test_compare_marks_what_else_differs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: dict[str, Any], text: str
) -> None:
    before, after = stored(tmp_path / "before.db"), stored(tmp_path / "after.db", **changes)
    assert compare([before, after, "--into", str(tmp_path / "page.html")]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("The runs also differ in the following")
    assert text in shown and text in (tmp_path / "page.html").read_text()


def test_compare_marks_settings_and_files_that_differ_and_not_those_that_a_factor_varies(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(name: str, speed: float, digest: str) -> str:
        path = tmp_path / name
        with open_database(path, create=True) as database:
            number = database.add_experiment(sample_description(ran_with={"file a.world": digest}), sample_episodes(2))
            for spec in sample_episodes(2):
                settings = {"method": spec.configuration, "parameters": {"/robot_speed_factor": speed}}
                database.write(number, sample_record(spec, snapshot={**SNAPSHOT, "settings": settings}))
        return str(path)

    assert compare([run("before.db", 1.0, "1a"), run("after.db", 0.5, "2b")]) == 0
    shown = capsys.readouterr().out
    assert "settings.parameters./robot_speed_factor: before 1.0; after 0.5" in shown
    assert "other content of file a.world" in shown and "settings.method" not in shown


@pytest.mark.parametrize(
    ("before", "after", "text"),
    [
        (PlanningSettings(), PlanningSettings(planning_time=1.0), "settings.planning_time: before 5.0; after 1.0"),
        (KinematicsSettings(), KinematicsSettings(timeout=0.5), "settings.timeout: before 0.05; after 0.5"),
        (
            GraspSettings(method_parameters={"yaw_step": 0.1}),
            GraspSettings(method_parameters={"yaw_step": 0.2}),
            "settings.method_parameters.yaw_step: before 0.1; after 0.2",
        ),
    ],
    ids=["planning", "kinematics", "grasps"],
)
def test_compare_marks_settings_that_differ_in_the_modes_without_simulation(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    before: EpisodeSettings,
    after: EpisodeSettings,
    text: str,
) -> None:
    def run(name: str, settings: EpisodeSettings) -> str:
        episodes = [replace(spec, settings=settings) for spec in sample_episodes(2)]
        report = ComponentReport("planning", "boxes", True, "", 0.0, 1.0, wall_s=1.0, ran=UsedSoftware())
        with open_database(tmp_path / name, create=True) as database:
            number = database.add_experiment(sample_description(), episodes)
            for spec in episodes:
                record = measured_record(
                    spec, EpisodeStatus.SUCCEEDED, "", report=report, folder=tmp_path, watch=Stopwatch()
                )
                assert record.snapshot["seed"] == spec.seed
                database.write(number, record)
        return str(tmp_path / name)

    assert compare([run("before.db", before), run("after.db", after)]) == 0
    assert text in capsys.readouterr().out


@pytest.mark.parametrize(
    ("after", "text"),
    [
        ({"slow": 0.3, "fast": 1.0}, "settings.parameters./speed with pace=slow: before 0.5; after 0.3"),
        ({"slow": 1.0, "fast": 0.5}, "settings.parameters./speed with pace=fast: before 1.0; after 0.5"),
        ({"slow": 0.4, "fast": 0.9}, "settings.parameters./speed with pace=fast: before 1.0; after 0.9"),
        ({"slow": 0.5, "fast": 1.0, "faster": 2.0}, ""),
        ({"fast": 1.0}, ""),
    ],
)
def test_compare_marks_what_differs_at_one_level_while_another_stays_equal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], after: dict[str, float], text: str
) -> None:
    def run(name: str, levels: dict[str, float]) -> str:
        episodes = [EpisodeSpec(0, {"pace": level}, 0, 1, TaskSettings()) for level in levels]
        episodes = [replace(spec, number=number) for number, spec in enumerate(episodes)]
        digests = {combination_key(spec.configuration): {f"{levels[spec.configuration['pace']]}"} for spec in episodes}
        description = sample_description(
            factors=(Factor("pace", tuple(levels)),), compared="pace", ran_with={"file a.yaml": digests_text(digests)}
        )
        with open_database(tmp_path / name, create=True) as database:
            number = database.add_experiment(description, episodes)
            for spec in episodes:
                settings = {"parameters": {"/speed": levels[spec.configuration["pace"]]}}
                database.write(number, sample_record(spec, snapshot={**SNAPSHOT, "settings": settings}))
        return str(tmp_path / name)

    assert compare([run("before.db", {"slow": 0.5, "fast": 1.0}), run("after.db", after)]) == 0
    shown = capsys.readouterr().out
    assert text in shown
    assert ("other content of file a.yaml" in shown) == ("also differ" in shown) == bool(text)


@pytest.mark.parametrize(
    ("changes", "warning"),
    [
        ({"packages": {"numpy": "2.5"}}, "The episodes did not all run with the same packages.numpy: 2.4 (4 "),
        (
            {"methods": {"top_down_grasps": {"version": "0.1.0", "sources": "bb"}}},
            "The episodes did not all run with the same methods.top_down_grasps.sources: aa (4 episodes); bb (4 ",
        ),
        ({"digests": {"world": "22"}}, "Episodes with the same levels did not all run with the same digests.world: 11"),
        (
            {"planners": {"RRTConnect of ompl": {"range": 0.2, "implementation": "OMPL"}}},
            "Episodes with the same levels did not all run with the same planners.RRTConnect of ompl.range: 0.1",
        ),
        ({"planners": {"RRTConnect of ompl": {"range": 0.1, "implementation": "OMPL"}}}, ""),
        ({"planners": {}, "digests": {}, "renderer": ""}, ""),
    ],
)
def test_a_report_warns_of_workers_that_ran_with_other_software(
    tmp_path: Path, changes: dict[str, Any], warning: str
) -> None:
    path = tmp_path / "results.db"
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), sample_episodes(2))
        for spec in sample_episodes(2):
            # the second trial runs on another worker
            own = {"digests": {"world": "11"}, "renderer": "tiny", **(changes if spec.trial else {})}
            database.write(number, sample_record(spec, snapshot={**SNAPSHOT, **own}))
    text = warnings(str(path))
    assert ("did not all run" in text) == bool(warning) and warning in text


def test_methods_that_ran_on_workers_with_other_packages_give_a_warning_and_worlds_of_levels_give_none(
    tmp_path: Path,
) -> None:
    path = tmp_path / "results.db"
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), sample_episodes(2))
        for spec in sample_episodes(2):
            version = "2.4" if spec.configuration["grasp_method"] == "top_down" else "2.5"
            own = {"digests": {"world": spec.configuration["object"]}, "packages": {"numpy": version}}
            database.write(number, sample_record(spec, snapshot={**SNAPSHOT, **own}))
    text = warnings(str(path))
    assert text.count("did not all run") == 1 and "the same packages.numpy: 2.4 (4 episodes); 2.5 (4 episodes)" in text


def test_compare_marks_nothing_where_only_measurements_differ(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = stored(tmp_path / "before.db")
    after = stored(tmp_path / "after.db", reference_s=0.11, load_before=3.0, others_share=0.5, earlier_tries=["x"])
    assert compare([before, after]) == 0
    assert "also differ" not in capsys.readouterr().out


def test_a_report_warns_of_a_load_of_faults_of_metrics_and_of_killed_tries(tmp_path: Path) -> None:
    text = warnings(
        stored(
            tmp_path / "results.db",
            others_share=0.35,
            metric_faults={"my_height": "KeyError: 'can'"},
            earlier_tries=["begun 2026-11-26 on lab-1: the worker process was killed by signal SIGKILL"],
        )
    )
    assert "8 episodes ran beside other processes that used up to 35 % of the machine" in text
    assert "which lengthens real times (planning_time)" in text
    assert "The metric my_height raised an error in 8 episodes: KeyError: 'can'." in text
    assert "8 attempts ended without a record, and the episodes ran again: begun 2026-11-26 on lab-1" in text


def test_a_report_warns_of_methods_whose_sources_are_unknown(tmp_path: Path) -> None:
    text = warnings(stored(tmp_path / "results.db", unknown_sources=["ws://127.0.0.1:8700"]))
    assert "8 episodes ran with a method or planner whose sources are unknown" in text and "ws://127.0.0.1:8700" in text
    assert warnings(stored(tmp_path / "known.db", unknown_sources=[])) == ""


def test_a_report_warns_of_real_times_beside_other_workers_of_the_run(tmp_path: Path) -> None:
    text = warnings(stored(tmp_path / "results.db", worker_count=2, workers_share=0.45))
    assert text == (
        "8 episodes ran beside other workers of the run that used up to 45 % of the machine, which lengthens real "
        "times (planning_time)."
    )
    assert warnings(stored(tmp_path / "many_cores.db", worker_count=2, workers_share=0.02)) == ""


def test_a_quiet_machine_gives_no_warning_and_the_report_shows_its_load(tmp_path: Path) -> None:
    path = stored(tmp_path / "results.db", [0.02, 0.02, 0.02, 0.02, 0.02, 0.03, 0.08, 0.08])
    assert warnings(path) == ""
    assert "load by other processes: 2 % of the machine, at most 8 %" in page_text(path)
    assert "load by other processes" not in page_text(stored(tmp_path / "unknown.db"))


def test_the_load_counts_other_processes_and_not_those_of_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def share_of(mark: str) -> float:
        monkeypatch.setenv(RUN_ID_VARIABLE, mark)
        command = [sys.executable, "-c", "while True: pass"]
        with subprocess.Popen(command) as busy:
            monkeypatch.setenv(RUN_ID_VARIABLE, "mine/worker/")
            before, spent = MachineLoad.now(), 0.0
            own = before.others_s.get(busy.pid)
            end = time.monotonic() + 30.0
            while spent < 0.2 and time.monotonic() < end and own is not None:
                spent = MachineLoad.now().others_s.get(busy.pid, 0.0) - own
            share = MachineLoad.now().since(before)["others_share"] if own is not None else 0.0
            busy.kill()
        return share

    assert share_of("another/worker/") > 0.0
    assert share_of("mine/other/") == 0.0


def test_the_time_of_the_other_workers_of_the_run_is_recorded_with_their_number(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(RUN_ID_VARIABLE, "mine/other/")
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy:
        monkeypatch.setenv(RUN_ID_VARIABLE, "mine/worker/")
        before, end = MachineLoad.now(), time.monotonic() + 30.0
        while (load := MachineLoad.now()).workers_s["other"] < before.workers_s["other"] + 0.2:
            assert time.monotonic() < end
        busy.kill()
    measured = load.since(before)
    assert measured["workers_share"] > 0.0 and measured["worker_count"] == 2
    assert MachineLoad.now().since(MachineLoad.now())["worker_count"] == 1


def test_a_process_of_the_run_whose_program_is_being_loaded_does_not_count_as_load(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Linux shows an empty environment of such a process; here the first reads do."""
    monkeypatch.setenv(RUN_ID_VARIABLE, "mine/worker/")
    read_bytes, reads = Path.read_bytes, []
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]) as process:

        def read_while_loading(path: Path) -> bytes:
            if path == Path(f"/proc/{process.pid}/environ"):
                reads.append(path)
                return b"" if len(reads) <= 3 else read_bytes(path)
            return read_bytes(path)

        monkeypatch.setattr(Path, "read_bytes", read_while_loading)
        others = MachineLoad.now().others_s
        process.kill()
    assert process.pid not in others


def test_the_reference_workload_takes_the_same_for_all_episodes_of_a_process() -> None:
    assert 0.001 < reference_s() == reference_s()
