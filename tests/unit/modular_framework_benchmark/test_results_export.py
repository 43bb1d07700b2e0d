# SPDX-License-Identifier: BSD-3-Clause
"""The command export writes what the database holds: CSV and Parquet as other libraries read them, LeRobot's layout."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pandas as pd
import pyarrow.parquet
import pytest
from sample_experiment import sample_description, sample_episodes, sample_record

from modular_framework_benchmark.commands.export_command import main
from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.results.database import open_database

EPISODES = sample_episodes()
BROKEN = 3
CAUSE = 'no "motion", found\nin 5 s'
JOINTS = ("shoulder", "elbow")
SAMPLES, PERIOD_S = 101, 0.01
RATE = 20
FRAMES = 21  # 1 s
SIZE = (32, 48)


def store(folder: Path) -> Path:
    """Makes a database; one of its episodes failed without a metric."""
    path = folder / "results.db"
    with open_database(path, create=True) as database:
        number = database.add_experiment(sample_description(), EPISODES)
        for spec in EPISODES:
            record = sample_record(spec)
            if spec.number == BROKEN:
                record = replace(
                    sample_record(spec, EpisodeStatus.FAILED), cause=CAUSE, metrics={"planning_time": math.nan}
                )
            database.write(number, record)
    return path


def export(*arguments: object) -> int:
    return main([str(argument) for argument in arguments])


def test_csv_holds_each_episode_and_span(tmp_path: Path) -> None:
    assert export(store(tmp_path), "--csv", tmp_path / "out") == 0
    with (tmp_path / "out" / "picks_episodes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["number"]) for row in rows] == list(range(len(EPISODES)))
    for row, spec in zip(rows, EPISODES, strict=True):
        assert {name: row[name] for name in spec.configuration} == dict(spec.configuration)
        assert (int(row["seed"]), int(row["trial"])) == (spec.seed, spec.trial)
        expected = "" if spec.number == BROKEN else str(0.125 * (spec.number + 1))
        assert (row["planning_time"] and str(float(row["planning_time"]))) == expected
    assert (rows[BROKEN]["status"], rows[BROKEN]["cause"]) == ("failed", CAUSE)
    with (tmp_path / "out" / "picks_spans.csv").open(newline="") as file:
        spans = list(csv.DictReader(file))
    assert len(spans) == 2 * len(EPISODES)
    assert (spans[0]["name"], float(spans[0]["ended_s"]), spans[1]["ended_s"]) == ("PICK/APPROACH", 4.0, "")
    description = json.loads((tmp_path / "out" / "picks.json").read_text())
    assert description["compared"] == "grasp_method"


def test_parquet_keeps_types_missing_values_and_the_description(tmp_path: Path) -> None:
    assert export(store(tmp_path), "--parquet", tmp_path / "out") == 0
    table = pyarrow.parquet.read_table(tmp_path / "out" / "picks_episodes.parquet")
    kinds = {name: str(table.schema.field(name).type) for name in ("number", "success", "planning_time")}
    assert kinds == {"number": "int64", "success": "bool", "planning_time": "double"}
    rows = table.to_pylist()
    assert [row["success"] for row in rows].count(False) == 1
    assert rows[BROKEN]["planning_time"] is None and rows[BROKEN]["cause"] == CAUSE
    description = json.loads(table.schema.metadata[b"modular_framework_benchmark.experiment"])
    assert [factor["name"] for factor in description["factors"]] == ["grasp_method", "object", "speed"]
    spans = pyarrow.parquet.read_table(tmp_path / "out" / "picks_spans.parquet").to_pylist()
    assert [span["ended_s"] for span in spans[:2]] == [4.0, None]


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = store(tmp_path)
    assert export(path, "--csv", tmp_path / "out") == 0
    before = (tmp_path / "out" / "picks_episodes.csv").read_bytes()
    assert export(path, "--csv", tmp_path / "out") == 2
    assert "picks_episodes.csv" in capsys.readouterr().err
    assert (tmp_path / "out" / "picks_episodes.csv").read_bytes() == before


def record_motion(folder: Path, spec_number: int, *, videos: bool = True, joints: tuple[str, ...] = JOINTS) -> None:
    """Writes the files that an episode leaves: its samples, its robot and a video that grows brighter."""
    folder.mkdir(parents=True)
    times = PERIOD_S * np.arange(SAMPLES)
    columns = {"time_s": 0.5 + times}
    for place, joint in enumerate(joints):
        columns[f"{joint}/position"] = (1.0 + spec_number) * times + place
        columns[f"{joint}/command"] = np.where(times < 0.25 - 1e-9, np.nan, np.where(times < 0.5 - 1e-9, 7.0, 8.0))
    columns |= {f"cup/{axis}": np.full(SAMPLES, 0.1 * place) for place, axis in enumerate(("x", "y", "z"))}
    pd.DataFrame(columns).to_parquet(folder / "trajectory.parquet")
    (folder / "parameters.json").write_text(json.dumps({"robot_description": "<robot name='two_links'/>"}))
    if videos:
        with av.open(str(folder / "video.mp4"), "w") as container:
            stream = container.add_stream("libx264", rate=10)
            stream.height, stream.width, stream.pix_fmt = *SIZE, "yuv420p"
            for place in range(20):
                image = np.full((*SIZE, 3), 10 * place, dtype=np.uint8)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
            container.mux(stream.encode())


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of the episodes of a database, all but one of which recorded their motion."""
    folder = tmp_path_factory.mktemp("lerobot")
    path = store(folder)
    for spec in EPISODES[:-1]:
        record_motion(folder / "picks" / f"episode_{spec.number}", spec.number)
    assert export(path, "--lerobot", folder / "dataset", "--rate", RATE) == 0
    return folder / "dataset"


def frames_of(dataset: Path) -> pd.DataFrame:
    return pd.read_parquet(dataset / "data" / "chunk-000" / "file-000.parquet")


def test_the_description_of_a_dataset_is_that_of_lerobot_3(dataset: Path) -> None:
    info = json.loads((dataset / "meta" / "info.json").read_text())
    count = len(EPISODES) - 1
    assert info["codebase_version"] == "v3.0"
    assert (info["fps"], info["robot_type"]) == (RATE, "two_links")
    assert (info["total_episodes"], info["total_frames"]) == (count, count * FRAMES)
    assert info["splits"] == {"train": f"0:{count}"}
    assert info["data_path"] == "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
    assert info["video_path"] == "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
    features = info["features"]
    assert features["action"] == {"dtype": "float32", "shape": [2], "names": list(JOINTS)}
    assert features["observation.environment_state"]["names"] == ["cup/x", "cup/y", "cup/z"]
    assert features["observation.images.scene"]["dtype"] == "video"
    assert features["observation.images.scene"]["shape"] == [*SIZE, 3]
    standard = {"timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64"}
    for name, kind in {**standard, "task_index": "int64"}.items():
        assert features[name] == {"dtype": kind, "shape": [1], "names": None}
    columns = {name for name, feature in features.items() if feature["dtype"] != "video"}
    assert set(frames_of(dataset).columns) == columns


def test_a_dataset_states_the_units_of_positions_and_commands(tmp_path: Path) -> None:
    path, folder = store(tmp_path), tmp_path / "picks" / f"episode_{EPISODES[0].number}"
    record_motion(folder, 0, videos=False)
    kinds = zip(JOINTS, ("revolute", "prismatic"), strict=True)
    joints = "".join(f"<joint name='{name}' type='{kind}'/>" for name, kind in kinds)
    (folder / "parameters.json").write_text(json.dumps({"robot_description": f"<robot name='r'>{joints}</robot>"}))
    assert export(path, "--lerobot", tmp_path / "dataset", "--rate", RATE) == 0
    features = json.loads((tmp_path / "dataset" / "meta" / "info.json").read_text())["features"]
    assert features["action"]["info"] == features["observation.state"]["info"] == {"units": ["rad", "m"]}
    assert "info" not in features["observation.environment_state"]


def test_frames_are_the_motion_at_the_rate_of_the_dataset(dataset: Path) -> None:
    frames = frames_of(dataset)
    assert frames["index"].tolist() == list(range(len(frames)))
    second = frames[frames["episode_index"] == 1]
    times = np.arange(FRAMES) / RATE
    assert second["frame_index"].tolist() == list(range(FRAMES))
    assert second["timestamp"].to_numpy() == pytest.approx(times, abs=1e-6)
    state = np.stack(second["observation.state"].to_list())
    assert state == pytest.approx(np.column_stack([2.0 * times, 2.0 * times + 1.0]), abs=1e-5)
    action = np.stack(second["action"].to_list())
    held = times < 0.25 - 1e-9  # before the first command: the measured position
    assert action[held] == pytest.approx(state[held])
    assert action[~held, 0].tolist() == [7.0 if time < 0.5 - 1e-9 else 8.0 for time in times[~held]]
    assert second["next.done"].tolist() == [False] * (FRAMES - 1) + [True]
    success = frames.groupby("episode_index")["next.success"].any()
    assert success[success.eq(False)].index.tolist() == [BROKEN]


def test_the_tables_of_episodes_and_tasks_lead_to_frames(dataset: Path) -> None:
    frames = frames_of(dataset)
    episodes = pyarrow.parquet.read_table(dataset / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    tasks = pd.read_parquet(dataset / "meta" / "tasks.parquet")
    for row in episodes:
        own = frames.iloc[row["dataset_from_index"] : row["dataset_to_index"]]
        assert own["episode_index"].unique().tolist() == [row["episode_index"]]
        assert row["length"] == len(own) == FRAMES
        assert [tasks.loc[task, "task_index"] for task in row["tasks"]] == own["task_index"].unique().tolist()
        assert (row["data/chunk_index"], row["data/file_index"]) == (0, 0)


def test_statistics_are_those_of_all_frames(dataset: Path) -> None:
    stats = json.loads((dataset / "meta" / "stats.json").read_text())
    state = np.stack(frames_of(dataset)["observation.state"].to_list()).astype(float)
    found = stats["observation.state"]
    assert found["count"] == [len(state)]
    for name, values in {"min": state.min(0), "max": state.max(0), "mean": state.mean(0), "std": state.std(0)}.items():
        assert found[name] == pytest.approx(values, rel=1e-5, abs=1e-6)
    assert np.shape(stats["observation.images.scene"]["mean"]) == (3, 1, 1)
    assert (
        0.0
        <= stats["observation.images.scene"]["min"][0][0][0]
        <= stats["observation.images.scene"]["max"][0][0][0]
        <= 1
    )


def test_videos_show_each_frame_of_each_episode(dataset: Path) -> None:
    row = pyarrow.parquet.read_table(dataset / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()[2]
    key = "videos/observation.images.scene"
    path = dataset / key / f"chunk-{row[f'{key}/chunk_index']:03d}" / f"file-{row[f'{key}/file_index']:03d}.mp4"
    with av.open(str(path)) as container:
        images = {
            round(float(frame.time) * RATE): frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)
        }
    first = round(row[f"{key}/from_timestamp"] * RATE)
    assert round(row[f"{key}/to_timestamp"] * RATE) == first + FRAMES == 3 * FRAMES
    shown = [float(images[first + place].mean()) for place in range(FRAMES)]
    expected = [10.0 * min(int((0.5 + place / RATE) * 10 + 1e-6), 19) for place in range(FRAMES)]
    assert shown == pytest.approx(expected, abs=6.0)  # lossy


def test_episodes_that_cannot_be_frames_are_left_out_with_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = store(tmp_path)
    record_motion(tmp_path / "picks" / "episode_0", 0, videos=False)
    record_motion(tmp_path / "picks" / "episode_1", 1, videos=False, joints=("other",))
    assert export(path, "--lerobot", tmp_path / "dataset") == 0
    said = capsys.readouterr()
    assert "1 episodes" in said.out
    assert "episode 1: it has action of other" in said.err
    assert "episode_2" in said.err and "no such file" in said.err
    assert json.loads((tmp_path / "dataset" / "meta" / "info.json").read_text())["video_path"] is None


def test_levels_and_success_choose_the_episodes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = store(tmp_path)
    for spec in EPISODES:
        record_motion(tmp_path / "picks" / f"episode_{spec.number}", spec.number, videos=False)
    chosen = ("--where", "object=can", "--where", "grasp_method=antipodal", "--succeeded")
    assert export(path, "--lerobot", tmp_path / "dataset", *chosen) == 0
    wanted = [spec for spec in EPISODES if {"can", "antipodal"} < set(spec.configuration.values())]
    assert frames_of(tmp_path / "dataset")["episode_index"].nunique() == len(wanted) - (
        BROKEN in [spec.number for spec in wanted]
    )
    assert export(path, "--lerobot", tmp_path / "other", "--where", "object=canoe") == 2
    assert "object=cup or can" in capsys.readouterr().err
    assert export(path, "--csv", tmp_path / "other", "--succeeded") == 2
    assert "require --lerobot" in capsys.readouterr().err


def test_without_recorded_motions_there_is_no_dataset(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert export(store(tmp_path), "--lerobot", tmp_path / "dataset") == 2
    assert "no episode can be exported" in capsys.readouterr().err
    assert not (tmp_path / "dataset").exists()
