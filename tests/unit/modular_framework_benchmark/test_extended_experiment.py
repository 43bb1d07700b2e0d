# SPDX-License-Identifier: BSD-3-Clause
"""An experiment is extended only by episodes that run with the same files, packages and parameters."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest
from sample_experiment import sample_description, sample_episodes, sample_record

from modular_framework_benchmark.episodes.ros_file_digests import model_resources, robot_files
from modular_framework_benchmark.episodes.ros_stack_launch import loaded_stack
from modular_framework_benchmark.experiments.grasps_mode import GraspSettings
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.modes.ros_run_digests import files_in_package, package_folders, run_digests
from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.episode_settings import OwnMetric, PlacedObject
from modular_framework_benchmark.records.experiment import ExperimentDescription, Factor
from modular_framework_benchmark.results.database import open_database
from modular_framework_benchmark.results.errors import ExperimentChangedError

LAUNCH = """<launch>
  <arg name="planner_configuration"/>
  <rosparam command="load" ns="move_group" file="$(arg planner_configuration)"/>
  <param name="world_file" value="{world}"/>
  <param name="gazebo_model_path" value="{folder}/models"/>
  <param name="robot_description" value="&lt;robot name='r'&gt;&lt;link name='l'&gt;&lt;visual&gt;&lt;geometry&gt;
    &lt;mesh filename='package://my_robot/meshes/arm.stl'/&gt;&lt;/geometry&gt;&lt;/visual&gt;&lt;/link&gt;&lt;/robot&gt;"/>
  <node pkg="top_down_grasps" type="top_down_grasp_generator" name="method" args="{poses}"/>
  <node pkg="modular_framework_core" type="robot_controllers_spawner" name="spawner" args="my_robot arm.yaml"/>
</launch>
"""


INCLUDE = "<sdf version='1.6'><world name='w'><include><uri>model://{}</uri></include></world></sdf>"
MODEL = """<sdf version='1.6'><model name='m'><link name='l'><visual name='v'><geometry>
  <mesh><uri>model://table/meshes/top.stl</uri></mesh></geometry></visual></link></model></sdf>"""
PACKAGE = "<package><name>my_robot</name><version>1.0.0</version><description>.</description></package>"

TASK_ARGUMENT = '<arg name="task_constructor_script" default=""/>'


class Stack:
    """A launch file whose files are in a folder.

    They are a planner configuration, a world with a model and a mesh, a file that a node is given, and a robot package
    with a mesh and the controllers of a spawner.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.controllers = folder / "my_robot" / "controllers" / "arm.yaml"
        self.robot_mesh = folder / "my_robot" / "meshes" / "arm.stl"
        self.model = folder / "models" / "table" / "model.sdf"
        self.mesh = folder / "models" / "table" / "meshes" / "top.stl"
        self.placed = folder / "models" / "can" / "model.sdf"
        self.metrics = folder / "own.py"
        for path in (self.controllers, self.robot_mesh, self.model, self.mesh, self.placed):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("1")
        (folder / "my_robot" / "package.xml").write_text(PACKAGE)
        self.model.write_text(MODEL)
        self.metrics.write_text("1")
        self.configuration, self.world, self.poses = folder / "planner.yaml", folder / "a.world", folder / "poses.yaml"
        self.configuration.write_text("planner_configs: {RRTConnect: {range: 0.1}}")
        self.world.write_text(INCLUDE.format("table"))
        self.poses.write_text("home: 1")
        self.launch = folder / "stack.launch"
        self.launch.write_text(self.text())

    def text(self, world: str = "a.world") -> str:
        return LAUNCH.format(world=self.folder / world, poses=self.poses, folder=self.folder)

    def settings(self, **changes: object) -> TaskSettings:
        arguments = {"planner_configuration": str(self.configuration)}
        settings = TaskSettings(
            launch=str(self.launch),
            arguments=arguments,
            objects=(PlacedObject("can_1", "can", 0.0, 0.0, 1.0),),
            metrics=(OwnMetric("own", f"{self.metrics}:own"),),
        )
        return replace(settings, **changes)  # type: ignore[arg-type]

    def spec_of_task(self, task: Path) -> EpisodeSpec:
        """Returns an episode of a task; the launch then has the argument of the task."""
        if TASK_ARGUMENT not in self.launch.read_text():
            self.launch.write_text(
                self.launch.read_text().replace("<rosparam command", f"{TASK_ARGUMENT}<rosparam command")
            )
        return EpisodeSpec(0, {}, 0, 1, self.settings(task=str(task)))

    def digests(self, *specs: EpisodeSpec) -> dict[str, str]:
        loaded_stack.cache_clear()  # as in another process
        return run_digests(specs or [EpisodeSpec(0, {}, 0, 1, self.settings())])


@pytest.fixture
def stack(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stack:
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path}:{os.environ['ROS_PACKAGE_PATH']}")
    for cached in (model_resources, robot_files, files_in_package, package_folders):
        cached.cache_clear()
    return Stack(tmp_path)


@pytest.mark.parametrize(
    ("changed", "text", "named"),
    [
        ("configuration", "planner_configs: {RRTConnect: {range: 0.2}}", "planner_configs/RRTConnect/range"),
        ("world", "<sdf version='1.7'/>", "/a.world"),
        ("poses", "home: 2", "/poses.yaml"),
        ("launch", LAUNCH.replace("{world}", ""), "parameter /world_file"),
        ("launch", LAUNCH.replace("<param", "<param name='new' value='1'/><param", 1), "parameter /new"),
        ("controllers", "2", "file controllers/arm.yaml"),
        ("robot_mesh", "2", "file meshes/arm.stl"),
        ("model", MODEL.replace("top", "leg"), "file table/model.sdf"),
        ("mesh", "2", "file meshes/top.stl"),
        ("placed", "2", "file can/model.sdf"),
        ("metrics", "2", "/own.py"),
    ],
)
@pytest.mark.parametrize("trials", [2, 4], ids=["run again", "extended"])
def test_a_file_that_was_edited_between_run_and_extension_is_refused_by_name(
    stack: Stack, tmp_path: Path, changed: str, text: str, named: str, trials: int
) -> None:
    with open_database(tmp_path / "results.db", create=True) as database:
        database.add_experiment(sample_description(ran_with=stack.digests()), sample_episodes(2))
        assert database.add_experiment(sample_description(ran_with=stack.digests()), sample_episodes(2)) == 1
        getattr(stack, changed).write_text(
            text.format(world=stack.world, poses=stack.poses, folder=stack.folder) if changed == "launch" else text
        )
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
        database.check_resumed(number, part)  # episodes of other levels may need fewer files
        stack.world.write_text("<sdf version='1.7'/>")
        with pytest.raises(ExperimentChangedError, match="ran with another state of .*/a.world"):
            database.check_resumed(number, stack.digests())


def test_an_extension_with_the_same_files_is_taken_also_with_a_level_that_brings_others(
    stack: Stack, tmp_path: Path
) -> None:
    def specs(**worlds: str) -> list[EpisodeSpec]:
        """Returns an episode of each level, with a launch file of its world."""
        for world in worlds.values():
            (tmp_path / f"{world}.launch").write_text(stack.text(world))
        launches = {level: str(tmp_path / f"{world}.launch") for level, world in worlds.items()}
        return [
            EpisodeSpec(number, {"place": level}, 0, 1, stack.settings(launch=launch))
            for number, (level, launch) in enumerate(launches.items())
        ]

    def described(digest: str, episodes: list[EpisodeSpec]) -> ExperimentDescription:
        factors = (Factor("place", tuple(spec.configuration["place"] for spec in episodes)),)
        ran_with = stack.digests(*episodes)
        return sample_description(digest=digest, factors=factors, compared="place", ran_with=ran_with)

    (tmp_path / "b.world").write_text(INCLUDE.format("can"))
    one, two = specs(near="a.world"), specs(near="a.world", far="b.world")
    with open_database(tmp_path / "results.db", create=True) as database:
        database.add_experiment(described("d1", one), one)
        database.add_experiment(described("d2", two), two)
        assert len(database.pending(1)) == 2
        database.write(1, sample_record(two[0]))
        database.check_resumed(1, stack.digests(two[1]))
        swapped = specs(near="a.world", far="b.world")
        (tmp_path / "b.world.launch").write_text(stack.text("a.world"))
        with pytest.raises(ExperimentChangedError, match="parameter /world_file"):
            database.add_experiment(described("d2", swapped), swapped)


def test_the_states_of_a_user_count(stack: Stack, tmp_path: Path) -> None:
    states = tmp_path / "states"
    states.mkdir()
    text = '<arg name="states_directory" default=""/><rosparam command'
    stack.launch.write_text(stack.launch.read_text().replace("<rosparam command", text))
    found = []
    for content in ("WAIT_S = 1", "WAIT_S = 2"):
        (states / "my_state.py").write_text(content)
        arguments = {"planner_configuration": str(stack.configuration), "states_directory": f"{tmp_path}/my:{states}"}
        digests = stack.digests(EpisodeSpec(0, {}, 0, 1, stack.settings(arguments=arguments)))
        found.append(digests["folder states_directory"])
    assert found[0] != found[1]


def test_packages_of_nodes_and_versions_of_libraries_count(stack: Stack) -> None:
    digests = stack.digests()
    assert {"package top_down_grasps", "package modular_framework_planning", "Python package numpy"} <= set(digests)


@pytest.mark.parametrize("mode", ["task", "grasps", "policy"])
def test_the_python_files_beside_the_script_of_an_external_method_count(
    stack: Stack, tmp_path: Path, mode: str
) -> None:
    script = tmp_path / "my_grasps" / "method.py"
    for name in ("method.py", "helper.py", "networks/encoder.py", "data/weights.txt", ".venv/lib/numpy.py"):
        (script.parent / name).parent.mkdir(parents=True, exist_ok=True)
        (script.parent / name).write_text("1")
    command = ["/usr/bin/python3", str(script), "--fast"]

    def folder_digest() -> str:
        settings = GraspSettings(method="a.b:C", method_parameters={"command": command})
        if mode == "grasps":
            return run_digests([EpisodeSpec(0, {}, 0, 1, settings)])["folder of my_grasps/method.py"]
        if mode == "policy":
            task = tmp_path / "task.yaml"
            task.write_text(f"params: {{own: {command}}}\nstates: [{{A: {{source: run_policy, command: params.own}}}}]")
            return stack.digests(stack.spec_of_task(task))["folder of my_grasps/method.py"]
        stack.launch.write_text(stack.launch.read_text().replace("<param", f"<rosparam>method: {{command: {command}}}"
                                "</rosparam><param", 1))  # fmt: skip
        return stack.digests()["folder of my_grasps/method.py"]

    before = folder_digest()
    for name, counts in (
        ("helper.py", True),
        ("networks/encoder.py", True),
        ("data/weights.txt", False),
        (".venv/lib/numpy.py", False),
    ):
        (script.parent / name).write_text("2")
        after = folder_digest()
        assert (after != before) == counts, name
        before = after


def test_the_dataset_that_a_task_replays_counts(stack: Stack, tmp_path: Path) -> None:
    dataset, task = tmp_path / "picks", tmp_path / "task.yaml"
    for name in ("meta/info.json", "data/chunk-000/file-000.parquet", "videos/scene.mp4"):
        (dataset / name).parent.mkdir(parents=True, exist_ok=True)
        (dataset / name).write_text("1")
    task.write_text(f"states: [{{A: {{source: run_policy, dataset: {dataset}}}}}]")
    spec = stack.spec_of_task(task)
    name = f"dataset {tmp_path.name}/picks"
    before = stack.digests(spec)[name]
    (dataset / "videos/scene.mp4").write_text("2")
    assert stack.digests(spec)[name] == before
    (dataset / "data/chunk-000/file-000.parquet").write_text("2")
    assert stack.digests(spec)[name] != before


def test_a_mode_without_launch_counts_its_robot_and_method() -> None:
    method = "top_down_grasps.ros_top_down_node:TopDownMethod"
    settings = GraspSettings(robot="ur5_ezgripper_moveit_config", method=method)
    digests = run_digests([EpisodeSpec(0, {}, 0, 1, settings)])
    assert {"package top_down_grasps", "package modular_framework_planning"} <= set(digests)
    assert {"robot description", "robot meshes", "file collision/base.stl"} <= set(digests)


def test_the_package_of_a_plugin_counts(stack: Stack) -> None:
    assert "package top_down_grasps" in stack.digests()
    parameters = {"/arm/type": "antipodal_grasps/Hardware"}
    digests = stack.digests(EpisodeSpec(0, {}, 0, 1, stack.settings(parameters=parameters)))
    assert "package antipodal_grasps" in digests and "package antipodal_grasps" not in stack.digests()
