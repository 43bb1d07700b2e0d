# SPDX-License-Identifier: BSD-3-Clause
"""An experiment file is read and checked before anything starts."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from experiment_texts import PICK, FakeResources, faults_of, read

from modular_framework_benchmark.experiments.experiment import StoppingKind
from modular_framework_benchmark.experiments.experiment_file import load_experiment, read_experiment
from modular_framework_benchmark.experiments.metric_choices import read_metrics
from modular_framework_benchmark.experiments.predicate_reading import PREDICATES
from modular_framework_benchmark.experiments.reading import ExperimentFault, Reading
from modular_framework_benchmark.metrics.registry import METRICS
from modular_framework_benchmark.predicates.conditions import (
    HeldFor,
    InRegion,
    Lifted,
    NoContact,
    OnTopOf,
    Region,
    Upright,
)
from modular_framework_benchmark.predicates.predicate import All, Any, InOrder, Not
from modular_framework_benchmark.predicates.progress import Milestone
from modular_framework_benchmark.records.episode_settings import OwnMetric
from modular_framework_benchmark.records.experiment import Direction, MetricKind
from modular_framework_benchmark.reports.tables import metric_title
from modular_framework_core.files.faults import FaultList
from modular_framework_core.files.located_yaml import load
from modular_framework_ros.reported_figures import Clock

ROOT = Path(__file__).resolve().parents[3]


def test_every_combination_has_the_settings_of_the_base_and_of_its_levels(tmp_path: Path) -> None:
    experiment = read(PICK, tmp_path)
    assert len(experiment.combinations) == 8
    found = {tuple(one.configuration.values()): one for one in experiment.combinations}
    combination = found["aside", "PRM", "ball"]
    settings = combination.settings
    assert settings.arguments == {"world_file": "table.world", "method_launch_file": "b/aside.launch"}
    assert settings.parameters == {"/planner_name": "PRM"}
    assert combination.objects[0].model == "ball"
    assert settings.launch == "modular_framework_api/start_framework.launch"


def test_another_launch_file_replaces_that_of_the_file(tmp_path: Path) -> None:
    known = {"task": {name: entry.metric for name, entry in METRICS.items()}}
    resources, path = FakeResources(tmp_path / "models"), tmp_path / "a.yaml"
    text = PICK.replace("mode: task", "mode: task\nlaunch: my_robot/my.launch")
    with pytest.raises(ExperimentFault, match="there is no launch file my_robot/my.launch"):
        read_experiment(text, path, resources, known)
    launch = "modular_framework_api/start_framework.launch"
    experiment = read_experiment(text, path, resources, known, launch=launch)
    assert {one.settings.launch for one in experiment.combinations} == {launch}


def test_a_value_that_is_only_a_level_keeps_its_type(tmp_path: Path) -> None:
    text = PICK.replace("planner: [RRTConnect, PRM]", "planner: [0.5, true, 3, word]").replace(
        "{/planner_name: $planner}", "{/a: $planner, /b: with $planner and $$}"
    )
    found = [one.settings.parameters for one in read(text, tmp_path).combinations[::2]][:4]
    assert [one["/a"] for one in found] == [0.5, True, 3, "word"]
    assert [one["/b"] for one in found] == ["with 0.5 and $", "with true and $", "with 3 and $", "with word and $"]


def test_the_height_of_a_surface_survives_pyyaml_and_its_old_name_is_read(tmp_path: Path) -> None:
    def poses(text: str) -> list[object]:
        return [item.sample((1, 0), 0) for item in read(text, tmp_path).combinations[0].objects]

    expected = poses(PICK)
    assert poses(yaml.safe_dump(yaml.safe_load(PICK))) == expected
    old = PICK.replace("rests_at: 0.8", "on: 0.8")
    assert poses(old) == expected
    with pytest.raises(ExperimentFault, match=r"experiment\.yaml:36:3: .* PyYAML writes this for the keys on and"):
        read(yaml.safe_dump(yaml.safe_load(old)), tmp_path)


def test_pyyaml_keeps_the_names_of_predicates_and_the_shipped_experiments() -> None:
    for name in PREDICATES:
        assert yaml.safe_load(f"{name}: 1") == {name: 1}
    shipped = sorted((ROOT / "src/modular_framework_api/experiments").glob("*.yaml"))
    assert shipped
    for file in shipped:
        assert yaml.safe_load(file.read_text()) == load(file, FaultList()).plain(), file


@pytest.mark.parametrize("old", ["on", "'on'"])
def test_the_old_name_of_a_predicate_is_read(old: str, tmp_path: Path) -> None:
    text = PICK.replace(
        "success: {lifted: 0.1}",
        "success: {on_top_of: {support: table}, any: [{on_top_of: {support: table}}, {upright: {}}]}\n"
        "progress: [{on_top_of: {support: table}, name: put_down}]",
    )
    found, expected = (read(each, tmp_path).combinations[0].settings for each in (text.replace("on_top_of", old), text))
    assert (found.success, found.progress) == (expected.success, expected.progress)


def test_a_listed_design_runs_only_what_it_lists(tmp_path: Path) -> None:
    listed = "\ndesign: [{method: above, planner: PRM, object: cube}, {object: cube, method: aside, planner: PRM}]\n"
    experiment = read(PICK + listed, tmp_path)
    assert [one.configuration["method"] for one in experiment.combinations] == ["above", "aside"]
    twice = faults_of(PICK + listed.replace("aside", "above"), tmp_path)
    assert any("this combination is listed twice; remove one of them" in one for one in twice)


def test_a_listed_method_without_another_one_to_compare_with_is_a_fault(tmp_path: Path) -> None:
    listed = (
        "\ndesign: [{method: above, planner: PRM, object: cube}, {method: aside, planner: PRM, object: ball},"
        " {method: above, planner: PRM, object: ball}]\n"
    )
    (fault,) = faults_of(PICK + listed, tmp_path)
    assert "object cube, planner PRM has only method 'above'; add another one to compare it with" in fault


PROGRESS = "progress: [{held_for: {}, name: grasped}, {lifted: {height: 0.2}, weight: 2}]"
REGIONS = "regions: {goal: {x: [0, 0.2], y: [0.4, 0.6]}, away: {x: [-0.3, -0.1], y: [0.4, 0.6]}}"


def test_predicates_and_milestones_are_about_the_first_object_unless_they_name_another(tmp_path: Path) -> None:
    text = PICK.replace(
        "success: {lifted: 0.1}",
        f"""{PROGRESS}
{REGIONS}
success:
  in_region: {{region: goal}}
  any: [{{on_top_of: {{support: table}}}}, {{not: {{upright: {{}}, no_contact: {{other: table}}}}}}]
  in_order: [{{held_for: {{duration: 1}}}}, {{no_contact: {{}}}}]
  hold_time: 1
""",
    )
    found = {one.configuration["object"]: one.settings for one in read(text, tmp_path).combinations}
    settings = found["ball"]
    assert settings.success.hold_s == 1.0 and not settings.success.is_pick
    goal = Region(name="goal", x=(0.0, 0.2), y=(0.4, 0.6))
    resting = Any((
        OnTopOf(object="ball_1", support="table"),
        Not(All((Upright(object="ball_1"), NoContact(object="ball_1", other="table")))),
    ))  # fmt: skip
    released = InOrder((HeldFor(object="ball_1", duration=1.0), NoContact(object="ball_1")))
    assert settings.success.required == All((InRegion(object="ball_1", region=goal), resting, released))
    assert settings.progress == (
        Milestone(name="grasped", predicate=HeldFor(object="ball_1")),
        Milestone(name="lifted", predicate=Lifted(object="ball_1", height=0.2), weight=2.0),
    )
    assert found["cube"].progress[0].predicate == HeldFor(object="cube_1")


@pytest.mark.parametrize(
    ("metric", "given", "fault"),
    [
        ("progress", ("success:", f"{PROGRESS}\nsuccess:"), "needs milestones; list them in the key progress"),
        ("hold_time", ("success: {", "success: {shake: 2, "), "needs a shake; add shake: SECONDS to the key success"),
    ],
)
def test_a_metric_that_no_episode_can_have_is_left_out(
    metric: str, given: tuple[str, str], fault: str, tmp_path: Path
) -> None:
    known = {"task": {name: entry.metric for name, entry in METRICS.items()}}

    def names(text: str) -> list[str]:
        resources = FakeResources(tmp_path / "models")
        return [
            metric.name for metric in read_experiment(text, tmp_path / "a.yaml", resources, known).description.metrics
        ]

    every = PICK.replace("metrics: [success, task_time]\n", "").replace("lifted: 0.1", "lifted: 0.1, hold_time: 2")
    listed = PICK.replace("[success, task_time]", f"[success, {metric}]")
    assert metric not in names(every) and metric in names(every.replace(*given))
    assert metric in names(listed.replace(*given))
    with pytest.raises(ExperimentFault, match=f"the metric '{metric}' {fault}"):
        names(listed)


def test_the_short_form_and_predicates_can_be_mixed(tmp_path: Path) -> None:
    text = PICK.replace("{lifted: 0.1}", "{lifted: 0.1, upright: {angle: 0.3}}")
    success = read(text, tmp_path).combinations[0].settings.success
    pick = (Lifted(object="cube_1", height=0.1), HeldFor(object="cube_1"))
    assert success.predicate("cube_1") == All((*pick, Upright(object="cube_1", angle=0.3)))


@pytest.mark.parametrize(
    ("success", "at", "fault"),
    [
        ("{liftd: {}}", "liftd", "the key of success 'liftd' is unknown; allowed: lifted, hold_time, shake, object,"),
        ("{on_top_of: {}}", "{}", "on_top_of needs the key 'support'; add it"),
        ("{on_top_of: {support: tabel}}", "tabel", "support of on_top_of 'tabel' is unknown; allowed: cube_1, ball_1, "
         "ground_plane, table; did you mean 'table'?"),
        ("{upright: {object: cub_1}}", "cub_1", "object of upright 'cub_1' is unknown; allowed: cube_1, ball_1;"),
        ("{object: cub_1}", "cub_1", "the object of success 'cub_1' is unknown; allowed: cube_1, ball_1; did you mean"),
        ("{in_region: {region: gaol}}", "gaol", "region of in_region 'gaol' is unknown; allowed: goal, away; did you"),
        ("{joint_at_least: {model: table, joint: slide, position: 1}}", "slide", "the joint of model 'table' in "
         "joint_at_least 'slide' is unknown; allowed: drawer_slide; did you mean 'drawer_slide'?"),
        ("{not: {joint_at_least: {model: cube_1, joint: lid, position: 1}}}", "lid", "the joint of model 'cube_1' in "
         "joint_at_least 'lid' is unknown; "),
        ("{upright: {angel: 0.1}}", "angel", "the key of upright 'angel' is unknown; allowed: duration, object, angle; "
         "did you mean 'angle'?"),
        ("{upright: {angle: 4}}", "4", "angle of upright must be a number from 0 to 3.1416, found the number 4"),
        ("{held_for: {duration: -1}}", "-1", "duration of held_for must be a number from 0 to 3600"),
        ("{stacked: {objects: [cube_1]}}", "{objects", "stacked needs at least two objects, the lowest first"),
        ("{collected: {region: bni}}", "bni", "region of collected 'bni' is unknown; allowed: goal, away"),
        ("{collected: {region: goal, count: 3}}", "3", "count of collected is 3; allowed: 1 to 2, the number of"),
        ("{collected: {region: goal, count: 0}}", "0", "count of collected must be a whole number from 1"),
        ("{collected: {region: goal, count: 1}, cleared: {region: goal}}", "{collected", "success contradicts itself"),
        ("{aligned: {position: [0, 1]}}", "[0", "position of aligned has 2 numbers; allowed: 3"),
        ("{all: {upright: {}}}", "{upright", "all must be a list such as [{on_top_of: {support: table}}, ...], found"),
        ("{all: [{uprigt: {}}]}", "uprigt", "the predicate 'uprigt' is unknown; allowed: lifted, held_for, in_region"),
        ("{not: {}}", "{}", "a predicate of not has no predicate; add one"),
        ("{all: [{in_region: {region: goal}}, {in_region: {region: away}}], shake: 1}", "{all",
         "success contradicts itself: 'cube_1' is in the region 'goal', but 'cube_1' is in the region 'away'"),
        ("{held_for: {}, no_contact: {}}", "{held_for", "success contradicts itself: 'cube_1' is in the gripper, but"),
        ("{held_for: {}, untouched: {}}", "{held_for", "success contradicts itself: 'cube_1' is in the gripper, but"),
        ("{untouched: {other: tabel}}", "tabel", "other of untouched 'tabel' is unknown; allowed: cube_1, ball_1,"),
        ("{lifted: {height: 0.2}, not_moved: {}}", "{lifted", "success contradicts itself: 'cube_1' is more than"),
        ("{upright: {}, not: {upright: {}}}", "{upright", "success contradicts itself: 'cube_1' stands upright, but"),
        ("{on_top_of: {support: cube_1}}", "{on_top_of", "success contradicts itself: 'cube_1' lies on 'cube_1' names"),
    ],
)  # fmt: skip
def test_a_wrong_predicate_is_refused_with_its_place_and_the_nearest_name(
    success: str, at: str, fault: str, tmp_path: Path
) -> None:
    text = PICK.replace("{model: $object,", "{model: cube, z: 1}\n  - {model: $object,").replace(
        "[cube, ball]", "[ball]"
    )
    text = text.replace("success: {lifted: 0.1}", f"{REGIONS}\nsuccess: {success}")
    (found,) = faults_of(text, tmp_path)
    line, column, message = found.split(":", 2)
    assert text.splitlines()[int(line) - 1][int(column) - 1 :].startswith(at)
    assert message.strip().startswith(fault)


@pytest.mark.parametrize(
    ("progress", "at", "fault"),
    [
        ("[]", "[]", "progress must be a list such as"),
        ("[{name: grasped}]", "{name", "a milestone of progress has no predicate; add one"),
        ("[{held_for: {}, weigt: 1}]", "weigt", "the key of a milestone 'weigt' is unknown; allowed: name, weight"),
        ("[{held_for: {}, weight: -1}]", "-1", "weight must be a number from 0 to 1e+06, found the number -1"),
        ("[{held_for: {}, weight: 0}]", "[", "every weight of progress is 0; make one of them greater"),
        ("[{held_for: {}}, {upright: {}}, {held_for: {}}]", "{held_for", "two milestones have the name 'held_for'"),
        ("[{lifted: {height: 0.2}}, {lifted: {height: 0.1}, name: low}]", "{lifted", "milestone 'low' is always"),
        ("[{held_for: {}, no_contact: {}}]", "{held_for", "a milestone of progress contradicts itself: 'cube_1' is in"),
    ],
)  # fmt: skip
def test_milestones_that_contradict_or_repeat_each_other_are_refused(
    progress: str, at: str, fault: str, tmp_path: Path
) -> None:
    text = PICK.replace("[cube, ball]", "[cube]").replace("success:", f"progress: {progress}\nsuccess:")
    (found,) = faults_of(text, tmp_path)
    line, column, message = found.split(":", 2)
    assert text.splitlines()[int(line) - 1][int(column) - 1 :].startswith(at)
    assert message.strip().startswith(fault)


@pytest.mark.parametrize(
    ("regions", "fault"),
    [
        ("{goal: {x: [0, 1]}}", "the region 'goal' has no y; add [LOW, HIGH] [m]"),
        ("{goal: {x: [1, 0], y: [0, 1]}}", "x of region 'goal' is [1.0, 0.0]; allowed: [LOW, HIGH] with LOW < HIGH"),
        ("{goal: {x: [0, 1], y: [0, 1], hight: [0, 1]}}", "the key of a region 'hight' is unknown; allowed: x, y, z"),
        ("[goal]", "regions must be a mapping such as {goal:"),
    ],
)
def test_a_wrong_region_is_refused(regions: str, fault: str, tmp_path: Path) -> None:
    (found,) = faults_of(PICK + f"\nregions: {regions}\n", tmp_path)
    assert fault in found


@pytest.mark.parametrize(
    ("old", "new", "at", "fault"),
    [
        ("mode: task", "mode: tsk", "tsk", "mode 'tsk' is unknown; allowed: task, planning"),
        ("trials: 6", "trails: 6", "trails", "the key 'trails' is unknown; allowed: experiment, mode"),
        ("trials: 6", "trials: 0", "0", "trials must be a whole number from 1 to"),
        ("trials: 6", "trials: six", "six", "trials must be a whole number from 1"),
        ("time_limit: 60", "time_limit: true", "true", "time_limit must be a number"),
        ("{world_file:", "{wrld_file:", "wrld_file", "the argument of modular_framework_api"),
        ("{world_file:", "{gui: perhaps, world_file:", "gui", "argument 'gui' is 'perhaps', allowed are"),
        ("{world_file:", "{end_with_task: true, world_file:", "end_with_task", "the argument 'end_with_task' cannot"),
        ("[cube, ball]", "[cube, bal]", "$object", "there is no model 'bal'; allowed: cube, ball, can"),
        ("$object", "$objct", "$objct", "'$objct' names no factor; allowed: method"),
        ("rests_at: 0.8", "rests_at: 0.8, z: 1", "{model", "an object has both z and rests_at"),
        ("rests_at: 0.8", "rests_at: 0.8, on: 0.8", "on", "the key of an object 'on' is unknown; allowed: model"),
        (", rests_at: 0.8", "", "{model", "an object has neither z nor rests_at"),
        ("[-0.2, 0.2]", "[0.2, -0.2]", "[0.2", "the range of x goes down from 0.2 to -0.2"),
        ("{normal: [0, 1]}", "{normal: [0, -1]}", "[0", "normal of yaw must be [MEAN, DEVIATION]"),
        ("{normal: [0, 1]}", "{gauss: [0, 1]}", "{gauss", "yaw must be a number, [LOW, HIGH], {normal"),
        ("lifted: 0.1", "lift: 0.1", "lift", "the key of success 'lift' is unknown; allowed: lifted"),
        ("lifted: 0.1", "lifted: -1", "-1", "lifted must be a number from 0 to 10, found the number -1"),
        ("compare: method", "compare: metod", "metod", "compare 'metod' is unknown"),
        ("compare: method", "", "experiment", "the experiment has no 'compare'; add it"),
        ("planner: [RRTConnect, PRM]", "planner: [RRTConnect, RRTConnect]", "RRTConnect", "factor 'planner' has"),
        ("planner: [RRTConnect, PRM]", "planner: []", "[", "factor 'planner' has no levels"),
        ("/planner_name: $planner", "planner_name: $planner", "planner_name", "the parameter 'planner_name' must"),
        ("/planner_name: $planner", "/planner_name: x", "planner", "factor 'planner' changes nothing"),
        ("[success, task_time]", "[succes]", "succes", "the metric 'succes' is unknown; allowed: success"),
        ("[success, task_time]", "[success, Success.py:f]", "Success.py", "there is no file"),
        ("[success, task_time]", "[success, success]", "success", "metrics has 'success' twice"),
        ("time_limit: 60", "stopping: {rule: sequental}", "sequental", "rule 'sequental' is unknown; allowed: fixed"),
        ("time_limit: 60", "stopping: {rule: sequential, metric: lift}", "lift", "the metric of stopping"),
        ("time_limit: 60", "stopping: {metric: success}", "{metric", "stopping has no rule; allowed: fixed"),
        ("time_limit: 60", "record: {vido: true}", "vido", "the key of record 'vido' is unknown; allowed: log"),
        ("mode: task", "mode: task\nmode: task", "mode", "the key 'mode' is given twice; first in line 3"),
    ],
)  # fmt: skip
def test_a_fault_says_where_it_is_what_was_found_and_what_is_allowed(
    old: str, new: str, at: str, fault: str, tmp_path: Path
) -> None:
    assert old in PICK
    text = PICK.replace(old, new, 1)
    (found,) = faults_of(text, tmp_path)
    line, column, message = found.split(":", 2)
    assert text.splitlines()[int(line) - 1][int(column) - 1 :].startswith(at)
    assert message.strip().startswith(fault)


def test_all_faults_are_told_at_once(tmp_path: Path) -> None:
    text = PICK.replace("trials: 6", "trials: x").replace("lifted", "lift").replace("compare: method", "compare: m")
    assert [one.split(":")[0] for one in faults_of(text, tmp_path)] == ["8", "15", "16"]


def test_two_factors_that_set_the_same_value_are_a_fault(tmp_path: Path) -> None:
    text = PICK.replace(
        "planner: [RRTConnect, PRM]", "planner: {RRTConnect: {arguments: {method_launch_file: x}}, P: }"
    )
    (fault,) = (one for one in faults_of(text, tmp_path) if "sets" in one)
    assert "factor 'planner' sets arguments.method_launch_file, which factor 'method' sets too" in fault


def test_a_file_that_is_missing_empty_or_no_yaml_is_refused(tmp_path: Path) -> None:
    from experiment_texts import METRICS, FakeResources

    with pytest.raises(ExperimentFault, match="there is no such file"):
        load_experiment(tmp_path / "none.yaml", FakeResources(tmp_path / "m"), METRICS)
    assert "the file is empty" in faults_of("# nothing\n", tmp_path)[0]
    assert "this is not valid YAML" in faults_of("experiment: [", tmp_path)[0]
    assert "the file must be a mapping" in faults_of("[1, 2]", tmp_path)[0]


def test_a_metric_of_ones_own_is_a_function_that_is_found_but_not_run(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "raise SystemExit\ndef swing(episode):\n    return 1.0\ndef two(a, b):\n    pass\n"
    )
    entry = "{function: mine.py:swing, better: lower, unit: s, kind: time, clock: simulated time}"
    experiment = read(PICK.replace("[success, task_time]", f"[success, {entry}]"), tmp_path)
    own = experiment.description.metrics[1]
    assert (own.name, own.better, own.unit, own.kind) == ("swing", Direction.LOWER, "s", MetricKind.TIME)
    assert experiment.metric_specs == ("success", OwnMetric("swing", f"{tmp_path / 'mine.py'}:swing", lowest=0.0))
    assert (
        "'swng' is unknown; allowed: swing, two; did you mean 'swing'"
        in faults_of(PICK.replace("[success, task_time]", "[mine.py:swng]"), tmp_path)[0]
    )
    assert "must take one argument" in faults_of(PICK.replace("[success, task_time]", "[mine.py:two]"), tmp_path)[0]


def test_the_time_limit_of_an_episode_limits_no_metric_and_a_limit_of_the_file_does(tmp_path: Path) -> None:
    assert [one.limit for one in read(PICK, tmp_path).description.metrics] == [None, None]
    text = PICK.replace("task_time]", "{metric: task_time, limit: 12}]")
    assert read(text, tmp_path).description.metrics[1].limit == 12.0


def test_the_times_of_a_planner_are_limited_by_its_own_budget(tmp_path: Path) -> None:
    known = {
        name: METRICS[name].metric for name in ("planning_time", "motion_duration", "planning_processor_time", "lift")
    }
    for budget_s in (5.0, None):
        metrics, _ = read_metrics(None, known, budget_s, Reading(FaultList(), tmp_path, FakeResources(tmp_path)))
        limits = {metric.name: metric.limit for metric in metrics}
        assert limits == dict.fromkeys(known) | {"planning_time": budget_s}


def test_a_duration_that_should_be_long_counts_as_0_where_an_episode_fails(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def held(episode):\n    return 1.0\n")
    entry = "{function: mine.py:held, kind: time, clock: simulated time, unit: s, better: higher}"
    assert read(PICK.replace("task_time]", f"{entry}]"), tmp_path).description.metrics[1].limit == 0.0


def test_a_time_of_ones_own_needs_its_clock_which_the_report_names(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def busy(episode):\n    return 1.0\n")

    def text(clock: str) -> str:
        entry = f"{{function: mine.py:busy, kind: time, unit: s, better: lower{clock}}}"
        return PICK.replace("task_time]", f"{entry}]")

    own = read(text(", clock: real time"), tmp_path).description.metrics[1]
    assert own.clock is Clock.WALL and own.depends_on_machine
    assert metric_title(own).startswith("busy [s, real time]")
    assert not read(text(", clock: simulated time"), tmp_path).description.metrics[1].depends_on_machine
    (missing,) = faults_of(text(""), tmp_path)
    assert "needs the key clock; allowed: simulated time, real time, processor time" in missing
    (unknown,) = faults_of(text(", clock: real tme"), tmp_path)
    assert "did you mean 'real time'" in unknown


def test_a_metric_of_ones_own_may_be_a_count_and_have_bounds(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def grips(episode):\n    return 1.0\n")
    entry = "{function: mine.py:grips, kind: count, lowest: 1, highest: 4}"
    own = read(PICK.replace("task_time]", f"{entry}]"), tmp_path).description.metrics[1]
    assert (own.kind, own.bounds) == (MetricKind.COUNT, (1.0, 4.0))


@pytest.mark.parametrize(
    ("entry", "fault"),
    [
        ("{metric: success, limit: 3}", "'success' is a rate, which has no limit; remove limit"),
        ("{function: mine.py:f, kind: rate, limit: 1}", "'f' is a rate, which has no limit; remove limit"),
        ("{function: mine.py:f, kind: partial_credit, limit: 0.5}", "'f' is a partial credit, which has no limit"),
        ("{function: mine.py:f, kind: partial_credit, better: lower}", "better must be higher for partial credit"),
        (
            "{function: mine.py:f, lowest: 5, highest: 1}",
            "highest must be a number above the smallest value, 5, found 1",
        ),
        ("{function: mine.py:f, kind: count, highest: 0}", "highest must be a number above the smallest value, 0"),
        (
            "{function: mine.py:f, lowest: 0, highest: 1, limit: 2}",
            "limit must be in the range of 'f', 0 to 1, found 2",
        ),
    ],
)
def test_a_limit_or_bound_that_the_statistics_cannot_use_is_a_fault(tmp_path: Path, entry: str, fault: str) -> None:
    (tmp_path / "mine.py").write_text("def f(episode):\n    return 1.0\n")
    (found,) = faults_of(PICK.replace("[success, task_time]", f"[task_time, {entry}]"), tmp_path)
    assert fault in found


@pytest.mark.parametrize("name", ["seed", "Status", "wall_s", "failure_class", "plannerid"])
def test_a_metric_with_the_name_of_a_column_is_a_fault(tmp_path: Path, name: str) -> None:
    (tmp_path / "mine.py").write_text("def f(episode):\n    return 1.0\n")
    entry = f"{{function: mine.py:f, name: {name}}}"
    (found,) = faults_of(PICK.replace("task_time]", f"{entry}]"), tmp_path)
    assert f"metric '{name}': the name is taken; rename it; allowed: names that differ in more than case" in found


def test_success_of_ones_own_must_be_a_rate(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def f(episode):\n    return 1.0\n")
    (found,) = faults_of(
        PICK.replace("[success, task_time]", "[{function: mine.py:f, name: success, kind: value}]"), tmp_path
    )
    assert "`success` is a rate" in found


@pytest.mark.parametrize("name", ["trial", "outcome", "success", "task_time"])
def test_a_factor_with_the_name_of_a_column_is_a_fault(tmp_path: Path, name: str) -> None:
    (found,) = faults_of(PICK.replace("object: [cube", f"{name}: [cube").replace("$object", f"${name}"), tmp_path)
    assert f"factor '{name}': the name is taken" in found


def test_the_episodes_know_the_allowed_values_of_a_metric_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def f(episode):\n    return 1.0\n")
    specs = {
        kind: read(PICK.replace("task_time]", f"{{function: mine.py:f, kind: {kind}}}]"), tmp_path).metric_specs[1]
        for kind in ("value", "count", "rate", "partial_credit")
    }
    allowed = {kind: (spec.is_rate, spec.lowest, spec.highest) for kind, spec in specs.items()}
    assert allowed["value"] == (False, None, None)
    assert allowed["count"] == (False, 0.0, None)
    assert allowed["rate"][0]
    assert allowed["partial_credit"] == (False, 0.0, 1.0)


def test_a_sequential_rule_is_read(tmp_path: Path) -> None:
    stopping = read(PICK + "stopping: {rule: sequential, smallest_difference: 0.1}\n", tmp_path).stopping
    assert (stopping.kind, stopping.metric, stopping.smallest_difference) == (StoppingKind.SEQUENTIAL, "success", 0.1)


def test_the_rule_of_the_readme_is_accepted_and_a_difference_is_a_share(tmp_path: Path) -> None:
    readme = Path(__file__).parents[3] / "src" / "modular_framework_benchmark" / "README.md"
    (rule,) = re.findall(r"`(\{rule: sequential.*?\})`", readme.read_text())
    assert read(PICK + f"stopping: {rule}\n", tmp_path).stopping.kind is StoppingKind.SEQUENTIAL
    (fault,) = faults_of(PICK + "stopping: {rule: sequential, smallest_difference: 5}\n", tmp_path)
    assert "smallest_difference must be a number from 1e-09 to 1" in fault


def test_a_planning_experiment_takes_its_problems_in_turn(tmp_path: Path) -> None:
    from modular_framework_benchmark.experiments.design import plan_episodes

    text = """
experiment: plans
mode: planning
robot: some_moveit_config
problems: problems
planner: $planner
factors: {planner: [RRTConnect, PRM]}
compare: planner
trials: 5
"""
    assert "there is no folder" in faults_of(text, tmp_path)[0]
    for family, number in (("box", 1), ("box", 2), ("cage", 1)):
        (tmp_path / "problems" / family).mkdir(parents=True, exist_ok=True)
        for kind in ("scene", "request"):
            (tmp_path / "problems" / family / f"{kind}{number:04}.yaml").write_text("{}")
    episodes = plan_episodes(read(text, tmp_path))
    names = {one.trial: one.settings.problem.name for one in episodes}
    assert [names[trial] for trial in range(5)] == ["box/0001", "box/0002", "cage/0001", "box/0001", "box/0002"]
    assert len({one.seed for one in episodes if one.settings.problem.name == "box/0001"}) == 2
    (fault,) = faults_of(text + "stopping: {rule: sequential}\n", tmp_path)
    assert "a sequential rule needs a problem for each trial: 3 problems, 5 trials" in fault
    assert read(text.replace("trials: 5", "trials: 3") + "stopping: {rule: sequential}\n", tmp_path).trials == 3
    (tmp_path / "problems" / "box" / "request0002.yaml").unlink()
    assert "has no request0002.yaml beside it" in faults_of(text, tmp_path)[0]
