# SPDX-License-Identifier: BSD-3-Clause
"""An experiment is extended only by episodes that run with the same files, packages and parameters."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from sample_experiment import sample_description, sample_episodes

from modular_framework_benchmark.episodes.ros_stack_launch import loaded_stack
from modular_framework_benchmark.experiments.grasps_mode import GraspSettings
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.modes.ros_run_digests import run_digests
from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.results.database import open_database
from modular_framework_benchmark.results.errors import ExperimentChangedError

LAUNCH = """<launch>
  <arg name="planner_configuration"/>
  <rosparam command="load" ns="move_group" file="$(arg planner_configuration)"/>
  <param name="world_file" value="{world}"/>
  <node pkg="top_down_grasps" type="top_down_grasp_generator" name="method" args="{poses}"/>
</launch>
"""


class Stack:
    """A launch file with a planner configuration, a world and a file that a node is given."""

    def __init__(self, folder: Path) -> None:
        self.configuration, self.world, self.poses = folder / "planner.yaml", folder / "a.world", folder / "poses.yaml"
        self.configuration.write_text("planner_configs: {RRTConnect: {range: 0.1}}")
        self.world.write_text("<sdf/>")
        self.poses.write_text("home: 1")
        self.launch = folder / "stack.launch"
        self.launch.write_text(LAUNCH.format(world=self.world, poses=self.poses))

    def digests(self) -> dict[str, str]:
        arguments = {"planner_configuration": str(self.configuration)}
        settings = TaskSettings(launch=str(self.launch), arguments=arguments)
        loaded_stack.cache_clear()  # as in another process
        return run_digests([EpisodeSpec(0, {}, 0, 1, settings)])


@pytest.fixture
def stack(tmp_path: Path) -> Stack:
    return Stack(tmp_path)


@pytest.mark.parametrize(
    ("changed", "text", "named"),
    [
        ("configuration", "planner_configs: {RRTConnect: {range: 0.2}}", "planner_configs/RRTConnect/range"),
        ("world", "<sdf version='1.7'/>", "/a.world"),
        ("poses", "home: 2", "/poses.yaml"),
        ("launch", LAUNCH.format(world="", poses=""), "parameter /world_file"),
    ],
)
@pytest.mark.parametrize("trials", [2, 4], ids=["run again", "extended"])
def test_a_file_that_was_edited_between_run_and_extension_is_refused_by_name(
    stack: Stack, tmp_path: Path, changed: str, text: str, named: str, trials: int
) -> None:
    with open_database(tmp_path / "results.db", create=True) as database:
        database.add_experiment(sample_description(ran_with=stack.digests()), sample_episodes(2))
        assert database.add_experiment(sample_description(ran_with=stack.digests()), sample_episodes(2)) == 1
        getattr(stack, changed).write_text(text)
        digest = "d1" if trials == 2 else "d2"
        with pytest.raises(ExperimentChangedError, match="ran with another state of ") as caught:
            database.add_experiment(
                sample_description(digest=digest, ran_with=stack.digests()), sample_episodes(trials)
            )
        assert named in str(caught.value)
        assert len(database.pending(1)) == len(sample_episodes(2))


def test_a_resumed_experiment_refuses_a_file_that_was_edited_meanwhile_by_name(stack: Stack, tmp_path: Path) -> None:
    with open_database(tmp_path / "results.db", create=True) as database:
        number = database.add_experiment(sample_description(ran_with=stack.digests()), sample_episodes(2))
        database.check_resumed(number, stack.digests())
        part = {name: value for name, value in stack.digests().items() if name.startswith("file")}
        database.check_resumed(number, part)  # the remaining episodes may need fewer files
        stack.world.write_text("<sdf version='1.7'/>")
        with pytest.raises(ExperimentChangedError, match="ran with another state of .*/a.world"):
            database.check_resumed(number, stack.digests())


def test_an_extension_with_the_same_files_is_taken_also_with_a_level_that_brings_others(
    stack: Stack, tmp_path: Path
) -> None:
    first = sample_description(ran_with=stack.digests())
    more = {name: f"{value} 0123" for name, value in stack.digests().items()} | {"file new.yaml": "4567"}
    with open_database(tmp_path / "results.db", create=True) as database:
        database.add_experiment(first, sample_episodes(2))
        database.add_experiment(replace(first, digest="d2", ran_with=more), sample_episodes(4))
        assert len(database.pending(1)) == len(sample_episodes(4))


def test_the_states_of_a_user_count(stack: Stack, tmp_path: Path) -> None:
    states = tmp_path / "states"
    states.mkdir()
    text = '<arg name="states_directory" default=""/><rosparam command'
    stack.launch.write_text(stack.launch.read_text().replace("<rosparam command", text))
    found = []
    for content in ("WAIT_S = 1", "WAIT_S = 2"):
        (states / "my_state.py").write_text(content)
        arguments = {"planner_configuration": str(stack.configuration), "states_directory": str(states)}
        loaded_stack.cache_clear()
        settings = TaskSettings(launch=str(stack.launch), arguments=arguments)
        digests = run_digests([EpisodeSpec(0, {}, 0, 1, settings)])
        found.append(digests["folder states_directory"])
    assert found[0] != found[1]


def test_packages_of_nodes_and_versions_of_libraries_count(stack: Stack) -> None:
    digests = stack.digests()
    assert {"package top_down_grasps", "package modular_framework_planning", "Python package numpy"} <= set(digests)


def test_a_mode_without_launch_counts_its_robot_and_method() -> None:
    method = "top_down_grasps.ros_top_down_node:TopDownMethod"
    settings = GraspSettings(robot="ur5_ezgripper_moveit_config", method=method)
    digests = run_digests([EpisodeSpec(0, {}, 0, 1, settings)])
    assert {"package top_down_grasps", "package modular_framework_planning"} <= set(digests)
