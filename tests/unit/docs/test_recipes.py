# SPDX-License-Identifier: BSD-3-Clause
"""The recipes of the page on contributions hold: each is followed in a copy of its package, and the result is run."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/contributing.md").read_text()
PATH = re.compile(r"`(src/[\w./]+)`")


class Recipe:
    """A section of the page, followed in a copy of a package.

    Attributes:
        named: Files and folders of the package that the steps of the section name.
        changed: Those of them that were changed, or that got a new file.
    """

    def __init__(self, title: str, package: str, folder: Path) -> None:
        section = PAGE.split(f"\n## {title}\n")[1].split("\n## ")[0]
        steps = section.split("**Shipped:**")[-1].split("\nTest: ")[0]
        self.named, self.changed = set(PATH.findall(steps)), set[str]()
        self._folder, self._package = folder, package
        shutil.copytree(ROOT / "src" / package, folder / "src" / package)

    def insert(self, path: str, before: str, text: str) -> None:
        """Inserts text before the only occurrence of another text."""
        self.changed.add(path)
        file = self._folder / path
        assert file.read_text().count(before) == 1, f"{path}: {before}"
        file.write_text(file.read_text().replace(before, text + before))

    def create(self, folder: str, name: str, text: str) -> None:
        """Writes a new file into a folder that the recipe names."""
        self.changed.add(folder)
        file = self._folder / folder / name
        assert file.parent.is_dir() and not file.exists()
        file.write_text(text)

    def append(self, folder: str, name: str, text: str) -> None:
        """Writes text at the end of a file in a folder that the recipe names."""
        self.changed.add(folder)
        with (self._folder / folder / name).open("a") as file:
            file.write(text)

    def run(self, code: str) -> str:
        """Runs a program with the changed package; returns its output."""
        assert self.changed == self.named, "the steps name the files that have to be changed, and no other"
        source = self._folder / "src" / self._package / "src"
        env = {
            **os.environ,
            "PYTHONPATH": f"{source}:{os.environ['PYTHONPATH']}",
            "ROS_PACKAGE_PATH": f"{self._folder / 'src'}:{os.environ['ROS_PACKAGE_PATH']}",
        }
        program = self._folder / "program.py"
        program.write_text(code)
        found = subprocess.run(
            [sys.executable, program],
            env=env,
            cwd=self._folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        assert found.returncode == 0, found.stdout
        return found.stdout


CONTROL = "src/modular_framework_control/src/modular_framework_control"
HALF_WAY = """
from modular_framework_control.controller_interface.controller import Controller
from modular_framework_control.hardware_interface.interfaces import PositionJointInterface


class HalfWayController(Controller):
    interface_class = PositionJointInterface

    def init(self, hw, root_nh, controller_nh):
        self._joint = hw.get_handle(controller_nh.get_param("joint"))
        self._goal = controller_nh.get_param("goal")
        return True

    def update(self, time_s, period_s):
        self._joint.command += 0.5 * (self._goal - self._joint.command)
"""
LOOP = """
from modular_framework_control.hardware_interface.interfaces import JointStateInterface
from modular_framework_testing.control.stepped_loop import SteppedLoop

half = {"type": "modular_framework_control/HalfWayController", "joint": "a", "goal": 0.8}
loop = SteppedLoop({"hw": {"joints": ["a"]}, "half": half, "misspelt": {**half, "gaol": 0.5}})
loop.manager.load_controller("half")
loop.manager.load_controller("misspelt")
loop.step()
loop.switch(["half"], [])
loop.step(20)
print(loop.robot_hw.get(JointStateInterface).get_handle("a").position)
"""


def test_a_controller(tmp_path: Path) -> None:
    recipe = Recipe("A controller", "modular_framework_control", tmp_path)
    recipe.create(f"{CONTROL}/controllers", "half_way_controller.py", HALF_WAY)
    recipe.insert(
        f"{CONTROL}/controller_manager/controller_types.py",
        '    "joint_state_controller/JointStateController"',
        '    "modular_framework_control/HalfWayController": f"{_CONTROLLERS}.half_way_controller:HalfWayController",\n',
    )
    recipe.create(
        "src/modular_framework_control/parameters",
        "HalfWayController.yaml",
        "includes: [modular_framework_control/controller]\nparameters:\n"
        '  joint: {type: str, doc: "Joint."}\n  goal: {type: float, doc: "Goal [rad]."}\n',
    )
    *log, position = recipe.run(LOOP).splitlines()
    assert any("parameter 'gaol'" in line and "did you mean 'goal'" in line for line in log)
    assert float(position) == pytest.approx(0.8, abs=1e-3)


GAZEBO = "src/modular_framework_simulation/src/modular_framework_simulation/gazebo_ros"
SWING = """
import math
from pathlib import Path

from gazebo_msgs.srv import GetJointPropertiesRequest
from modular_framework_simulation.gazebo_ros.joint_services import JointServices
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_testing.simulation.simulated_samples import hinged_model, run


class Served:
    def __init__(self):
        self.works = {}

    def serve(self, name, kind, work):
        self.works[name] = work

    command = serve


world = PhysicsWorld(PhysicsSettings(1_000_000), ConvexParts(Path("parts")), (0.0, 0.0, -9.81))
world.spawn(hinged_model("pendulum", 0.5))
run(world, 0.2)
served = Served()
JointServices(world).connect(served)
radians, degrees = (
    served.works[f"/gazebo/get_joint_{name}"](GetJointPropertiesRequest("pendulum::hinge")).position[0]
    for name in ("properties", "degrees")
)
print(radians, degrees)
"""


def test_a_gazebo_service(tmp_path: Path) -> None:
    recipe = Recipe("A gazebo service", "modular_framework_simulation", tmp_path)
    recipe.insert(
        f"{GAZEBO}/ros_names.py", "SET_JOINT_PROPERTIES =", 'GET_JOINT_DEGREES = "/gazebo/get_joint_degrees"\n'
    )
    services = f"{GAZEBO}/joint_services.py"
    recipe.insert(
        services,
        "        endpoints.serve(ros_names.SET_JOINT_PROPERTIES",
        "        endpoints.serve(ros_names.GET_JOINT_DEGREES, srv.GetJointProperties, self._get_degrees)\n",
    )
    recipe.insert(
        services,
        "    def _set_properties(",
        "    def _get_degrees(self, request: Any) -> Any:\n"
        "        response = self._get_properties(request)\n"
        "        response.position = [math.degrees(value) for value in response.position]\n"
        "        return response\n\n",
    )
    radians, degrees = map(float, recipe.run(SWING).split())
    assert radians > 0.1 and degrees == pytest.approx(math.degrees(radians))


PHYSICS = "src/modular_framework_simulation/src/modular_framework_simulation/physics"
ON_THE_MOON = """
from modular_framework_simulation.physics.pybullet_engine import PyBulletEngine


class MoonEngine(PyBulletEngine):
    name = "moon"

    def __init__(self, settings, gravity, gui, log):
        super().__init__(settings, tuple(axis / 6.0 for axis in gravity), gui, log)
"""
FALL = """
from pathlib import Path

from modular_framework_ros.parameter_declarations import node_declaration
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_testing.simulation.simulated_samples import solid

world = PhysicsWorld(PhysicsSettings(1_000_000), ConvexParts(Path("parts")), (0.0, 0.0, -9.81), engine="moon")
world.spawn(solid("ball", specs.Sphere(0.05), Pose((0.0, 0.0, 5.0))))
for _ in range(1000):
    world.step()
print(world.entity_state("ball").pose.position[2])
print(node_declaration("modular_framework_simulation", "simulation").parameters["~physics_engine"].choices)
"""


def test_a_physics_engine(tmp_path: Path) -> None:
    recipe = Recipe("A physics engine", "modular_framework_simulation", tmp_path)
    recipe.create(PHYSICS, "moon_engine.py", ON_THE_MOON)
    choice = f"{PHYSICS}/engine_choice.py"
    recipe.insert(choice, "MUJOCO)\n", '"moon", ')
    recipe.insert(
        choice,
        '        case "mujoco":\n',
        '        case "moon":\n'
        "            from modular_framework_simulation.physics.moon_engine import MoonEngine\n\n"
        "            return MoonEngine(settings, gravity, gui, log)\n",
    )
    recipe.insert("src/modular_framework_simulation/parameters/simulation.yaml", "pybullet, mujoco]", "moon, ")
    height, choices = recipe.run(FALL).splitlines()
    assert float(height) == pytest.approx(5.0 - 0.5 * 9.81 / 6.0, abs=2e-3)
    assert "moon" in choices


VIEWER = "src/modular_framework_simulation/src/modular_framework_simulation/viewer"
DRAW = """
from modular_framework_simulation.viewer.ros_viewer_node import ViewerNode
from modular_framework_simulation.viewer.web_server import WebServer, free_port

server = WebServer("127.0.0.1", free_port("127.0.0.1", 8900))
node = ViewerNode(server, "world", False)
node._draw()
node._draw()
print(node._panel._pictures.content)
server.viser.stop()
"""


def test_a_browser_panel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    recipe = Recipe("A browser panel", "modular_framework_simulation", tmp_path)
    recipe.insert(
        f"{VIEWER}/control_panel.py",
        "    def _add_time_controls(",
        "        with gui.add_folder('Drawing'):\n            self._pictures = gui.add_markdown('')\n\n"
        "    def show_pictures(self, number: int) -> None:\n"
        "        self._pictures.content = f'{number} pictures drawn'\n\n",
    )
    node = f"{VIEWER}/ros_viewer_node.py"
    recipe.insert(node, "        self._panel.on_replay(", "        self._drawn = 0\n")
    recipe.insert(
        node,
        "        self._draw_image()\n",
        "        self._drawn += 1\n        self._panel.show_pictures(self._drawn)\n",
    )
    assert recipe.run(DRAW).splitlines()[-2] == "2 pictures drawn"


BENCHMARK = "src/modular_framework_benchmark/src/modular_framework_benchmark"
MEASURED = """
from pathlib import Path

from modular_framework_benchmark.commands.export_command import main as export
from modular_framework_benchmark.commands.ros_make_problems import main as make_problems
from modular_framework_benchmark.commands.ros_run_command import run_experiment

EXPERIMENT = '''
experiment: points
mode: planning
robot: ur5_ezgripper_moveit_config
problems: problems
planner: $planner
planning_time: 5
metrics: [success, planned_motions]
factors: {planner: [RRTConnect, BKPIECE]}
compare: planner
trials: 1
seed: 1
time_limit: 60
'''
if __name__ == "__main__":
    assert make_problems(["ur5_ezgripper_moveit_config", "arm", "problems", "--count", "1"]) == 0
    Path("points.yaml").write_text(EXPERIMENT)
    assert run_experiment(["points.yaml", "--database", "points.db"]) == 0
    assert export(["points.db", "--csv", "tables"]) == 0
"""


def test_a_metric(tmp_path: Path) -> None:
    recipe = Recipe("A metric", "modular_framework_benchmark", tmp_path)
    metrics = f"{BENCHMARK}/metrics"
    recipe.append(
        metrics,
        "planning.py",
        '\n\ndef planned_motions(episode: EpisodeMeasurements) -> float | None:\n    """Number of motions."""\n'
        '    return float(len(episode.of_component("planning")))\n',
    )
    recipe.insert(
        f"{metrics}/registry.py",
        "    _make_metric(kinematics.solved_share,",
        "    _make_metric(planning.planned_motions, _COUNT, _LOWER),\n",
    )
    recipe.run(MEASURED)
    (episodes,) = (tmp_path / "tables").glob("*_episodes.csv")
    assert pd.read_csv(episodes)["planned_motions"].tolist() == [1.0, 1.0]


SUMMARISED = f"""
import sys
from pathlib import Path

sys.path.insert(0, {str(ROOT / "tests/unit/modular_framework_benchmark")!r})
from reported_experiment import ReportedExperiment
from statistics_results import LENGTH, results_of

from modular_framework_benchmark.commands.report_command import main
from modular_framework_benchmark.statistics.analysis import summarise

results = results_of({{"a": ["succeeded"] * 3}}, [LENGTH], {{"path_length": {{"a": [2.0, 5.0, 3.0]}}}})
print(next(each for each in summarise(results) if each.metric == "path_length").largest)
sys.exit(main([str(ReportedExperiment(trials=8).store(Path("results.db"))), "--table", "markdown"]))
"""
LARGEST_TEXT = """def _largest(summaries, metric):
    return ", ".join(f"{item.method} {item.largest:g}" for item in summaries if item.metric == metric and item.largest)


"""


def test_a_statistic_of_the_report(tmp_path: Path) -> None:
    recipe = Recipe("A statistic of the report", "modular_framework_benchmark", tmp_path)
    recipe.insert(
        f"{BENCHMARK}/statistics/comparison.py",
        "\n\n@dataclass(frozen=True, slots=True, kw_only=True)\nclass PairCounts:",
        "    largest: float | None = None\n",
    )
    recipe.insert(
        f"{BENCHMARK}/statistics/summaries.py",
        "        quartiles=quartiles, sentence=",
        "        largest=float(known.values.max()) if len(known.values) else None,\n",
    )
    tables = f"{BENCHMARK}/reports/tables.py"
    recipe.insert(tables, "def _without_interval(", LARGEST_TEXT)
    recipe.insert(tables, "Cell(shown_text(of_metric))", "Cell(_largest(content.analysis.summaries, metric.name)), ")
    recipe.insert(tables, '"what is shown"), tuple(rows)', '"largest", ')
    largest, *table = recipe.run(SUMMARISED).splitlines()
    assert float(largest) == 5.0
    heading = next(line for line in table if line.startswith("|")).split("|")
    row = next(line for line in table if line.startswith("| task")).split("|")
    assert re.match(r"rrt\\_connect [\d.]+, bitstar [\d.]+", row[heading.index(" largest ")].strip())
