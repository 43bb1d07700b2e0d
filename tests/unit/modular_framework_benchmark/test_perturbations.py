# SPDX-License-Identifier: BSD-3-Clause
"""Perturbations of an experiment: axes are checked, levels reach the objects, all levels of a trial share its scene."""

from __future__ import annotations

import itertools
import json
import math
import re
from collections import defaultdict
from dataclasses import fields
from pathlib import Path

import pytest
from experiment_texts import PICK, faults_of, read
from scipy.stats import qmc

from modular_framework_benchmark.experiments.design import plan_episodes, stack_of
from modular_framework_benchmark.experiments.modes import stored_settings
from modular_framework_benchmark.experiments.perturb_reading import perturbations_of, with_run_labels
from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.episode_settings import as_json
from modular_framework_benchmark.records.perturbation import AXES, ObjectPerturbation, Perturbation

DOCUMENT = Path(__file__).parents[3] / "docs" / "perturbations.md"
AXES_TEXT = """
perturb:
  axes:
    perceived_pose_error: {unit: mm, levels: [0, 10, 20]}
    object_mass: {unit: factor, range: [1, 4], steps: 4}
"""
SOBOL = """
perturb:
  design: sobol
  points: 8
  axes:
    perceived_pose_error: {unit: mm, range: [0, 30]}
    object_friction: {unit: factor, range: [0.2, 1]}
"""
LEVELS = [
    "nominal",
    "perceived_pose_error=10 mm",
    "perceived_pose_error=20 mm",
    *(f"object_mass={n}" for n in (2, 3, 4)),
]


def episodes_of(text: str, folder: Path) -> list[EpisodeSpec]:
    return plan_episodes(read(PICK + text, folder))


def test_one_axis_at_a_time_runs_each_level_with_all_other_axes_nominal(tmp_path: Path) -> None:
    experiment = read(PICK + AXES_TEXT, tmp_path)
    (factor,) = (each for each in experiment.description.factors if each.name == "perturbation")
    assert list(factor.levels) == LEVELS
    found = {one.configuration["perturbation"]: one.settings.perturbation for one in experiment.combinations}
    assert found["nominal"] == Perturbation()
    assert found["perceived_pose_error=20 mm"] == Perturbation(perceived_pose_error=0.02)
    assert found["object_mass=3"] == Perturbation(object_mass=3.0)
    assert len(experiment.combinations) == 8 * len(LEVELS)


def test_the_objects_of_an_episode_have_what_its_level_says(tmp_path: Path) -> None:
    objects = defaultdict(list)
    for one in episodes_of(AXES_TEXT, tmp_path):
        objects[one.configuration["perturbation"]].append(one.settings.objects[0].perturbed)
    assert set(objects["nominal"]) == {None}
    assert set(objects["object_mass=2"]) == {ObjectPerturbation(mass=2.0)}
    errors = [item.pose_error for item in objects["perceived_pose_error=20 mm"]]
    assert [math.hypot(*error) for error in errors] == pytest.approx([0.02] * len(errors))
    assert len({error for error in errors}) == len(errors) / 2  # one direction for the two methods of a pair


def test_all_levels_and_methods_of_a_trial_share_scene_seed_and_direction_of_the_error(tmp_path: Path) -> None:
    trials = defaultdict(list)
    for one in episodes_of(AXES_TEXT, tmp_path):
        trials[one.trial, one.configuration["planner"], one.configuration["object"]].append(one)
    assert len(trials) == 6 * 2 * 2
    for episodes in trials.values():
        assert len(episodes) == 2 * len(LEVELS)
        assert len({one.seed for one in episodes}) == 1
        assert len({(one.settings.objects[0].xyz, one.settings.objects[0].rpy) for one in episodes}) == 1
        errors = [one.settings.objects[0].perturbed for one in episodes]
        angles = [math.atan2(*item.pose_error) for item in errors if item and any(item.pose_error)]
        assert angles == pytest.approx([angles[0]] * 4, abs=1e-6)
    plain = {(one.trial, one.key.replace(";", ",")): one.seed for one in episodes_of("", tmp_path)}
    assert set(plain.values()) == {episodes[0].seed for episodes in trials.values()}


def test_a_larger_object_rests_on_the_same_surface(tmp_path: Path) -> None:
    text = "perturb: {axes: {object_size: {unit: factor, levels: [2]}}}\n"
    heights = {
        (one.configuration["object"], one.configuration["perturbation"]): one.settings.objects[0].z
        for one in episodes_of(text, tmp_path)
    }
    assert heights["cube", "nominal"] == pytest.approx(0.8 + 0.001 + 0.03)
    assert heights["cube", "object_size=2"] == pytest.approx(0.8 + 0.001 + 0.06)
    assert heights["ball", "object_size=2"] == pytest.approx(0.8 + 0.001 + 0.1)


BLOCKS = PICK.replace("  object: [cube, ball]\n", "").replace(
    "{model: $object, x: [-0.2, 0.2], y: {choice: [0.4, 0.5]}, yaw: {normal: [0, 1]}, rests_at: 0.8}",
    "{model: cube, name: block, count: 3, size: [0.04, 0.06], spacing: 0.13, x: [-0.2, 0.2], y: [0.4, 0.6], "
    "yaw: [-3, 3], rests_at: 0.8}",
)


def test_several_objects_keep_their_poses_and_drawn_sizes_at_every_level(tmp_path: Path) -> None:
    text = """
perturb:
  axes:
    object_size: {unit: factor, levels: [0.5, 2]}
    perceived_pose_error: {unit: mm, levels: [10, 20]}
"""
    trials = defaultdict(dict)
    for one in plan_episodes(read(BLOCKS + text, tmp_path)):
        key = (one.trial, one.configuration["planner"], one.configuration["method"])
        trials[key][one.configuration["perturbation"]] = one
    assert len(trials) == 6 * 2 * 2
    for levels in trials.values():
        assert len(levels) == 5 and len({one.seed for one in levels.values()}) == 1
        nominal = levels["nominal"].settings.objects
        assert all(math.dist(a.xyz[:2], b.xyz[:2]) >= 0.13 for a, b in itertools.combinations(nominal, 2))
        assert all(block.perturbed is None and 0.04 / 0.06 <= block.scale <= 1.0 for block in nominal)
        for label, one in levels.items():
            factor = float(label.partition("object_size=")[2] or 1.0)
            for block, before in zip(one.settings.objects, nominal, strict=True):
                assert (block.x, block.y, block.rpy) == (before.x, before.y, before.rpy)
                assert block.scale == pytest.approx(factor * before.scale, abs=2e-6)
                # the model is 0.06 m high; the block begins 1 mm above the surface
                assert block.z == pytest.approx(0.801 + 0.03 * block.scale, abs=1e-6)
        near, far = (
            [block.perturbed.pose_error for block in levels[f"perceived_pose_error={value} mm"].settings.objects]
            for value in (10, 20)
        )
        for one, other in zip(near, far, strict=True):
            assert (2 * one[0], 2 * one[1]) == pytest.approx(other, abs=1e-8)
        assert len(set(near)) == 3  # each block has its own direction


def test_objects_without_a_place_in_another_size_are_refused(tmp_path: Path) -> None:
    size = "perturb: {axes: {object_size: {unit: factor, levels: [2]}}}\n"
    crowded = BLOCKS.replace("spacing: 0.13", "spacing: 0.1")
    read(crowded, tmp_path)
    (fault,) = faults_of(crowded + size, tmp_path)
    assert fault.endswith(
        "3 objects with a spacing of 0.1 m could overlap; allowed: at least the diagonal of the model with "
        "object_size 2, 0.113 m"
    )
    faults = faults_of(PICK.replace("rests_at: 0.8", "z: 0.9") + size, tmp_path)
    reason = "has z, and in another size it would not rest on its surface; write rests_at instead of z"
    assert len(faults) == 2 and all(reason in one for one in faults)


def test_a_listed_design_runs_with_every_perturbation(tmp_path: Path) -> None:
    listed = """
design:
  - {method: above, planner: PRM, object: cube}
  - {method: aside, planner: PRM, object: cube}
  - {method: above, planner: RRTConnect, object: ball}
  - {method: aside, planner: RRTConnect, object: ball}
"""
    found = [one.configuration for one in read(PICK + listed + AXES_TEXT, tmp_path).combinations]
    assert [one["perturbation"] for one in found] == 4 * LEVELS
    assert {(one["planner"], one["object"]) for one in found} == {("PRM", "cube"), ("RRTConnect", "ball")}


def test_near_levels_have_distinct_labels(tmp_path: Path) -> None:
    text = "perturb: {axes: {object_mass: {unit: factor, levels: [1.2345678, 1.2345679]}}}\n"
    combinations = read(PICK + text, tmp_path).combinations
    found = {one.configuration["perturbation"]: one.settings.perturbation.object_mass for one in combinations}
    assert found == {"nominal": 1.0, "object_mass=1.2345678": 1.2345678, "object_mass=1.2345679": 1.2345679}


def test_the_episodes_of_all_levels_share_a_stack_and_store_what_was_applied(tmp_path: Path) -> None:
    episodes = episodes_of(AXES_TEXT, tmp_path)
    assert len({stack_of(one.settings) for one in episodes}) == 4
    stored = [json.loads(json.dumps(as_json(one.settings))) for one in episodes]
    assert {each["perturbation"]["perceived_pose_error"] for each in stored} == {0.0, 0.01, 0.02}
    assert [stored_settings("task", each) for each in stored] == [one.settings for one in episodes]


def test_a_space_filling_design_has_the_points_of_scipy_and_states_them_in_its_labels(tmp_path: Path) -> None:
    experiment = read(PICK + SOBOL, tmp_path)
    applied = {
        one.configuration["perturbation"]: (
            1000 * one.settings.perturbation.perceived_pose_error,
            one.settings.perturbation.object_friction,
        )
        for one in experiment.combinations
    }
    assert len(applied) == 9 and applied.pop("nominal") == (0.0, 1.0)
    expected = qmc.scale(qmc.Sobol(2, rng=1).random(8), (0.0, 0.2), (30.0, 1.0))
    assert sorted(applied.values()) == [pytest.approx(tuple(point), rel=1e-3) for point in sorted(expected.tolist())]
    levels = with_run_labels(perturbations_of(PICK + SOBOL.replace("8", "16")), ["nominal", *applied]).levels
    read_back = {level.label: tuple(level.values.values()) for level in levels[1:]}
    assert read_back == {label: pytest.approx(values) for label, values in applied.items()}


def test_the_perturbations_of_a_stored_text_are_those_that_ran(tmp_path: Path) -> None:
    found = perturbations_of(PICK + AXES_TEXT)
    assert found is not None and [level.label for level in found.levels] == LEVELS
    assert [(axis.name, axis.unit, axis.nominal) for axis in found.axes] == [
        ("perceived_pose_error", "mm", 0.0),
        ("object_mass", "factor", 1.0),
    ]
    assert perturbations_of(PICK) is None


def test_a_nominal_point_and_a_wanted_success_are_read(tmp_path: Path) -> None:
    text = """
perturb:
  wanted_success: 0.8
  axes:
    perceived_pose_error: {unit: m, levels: [0, 0.01], nominal: 0.005}
    object_mass: {unit: factor, levels: [2]}
"""
    found = {
        one.configuration["perturbation"]: one.settings.perturbation for one in read(PICK + text, tmp_path).combinations
    }
    assert found["object_mass=2"] == Perturbation(object_mass=2.0, perceived_pose_error=0.005)
    assert found["nominal"] == Perturbation(perceived_pose_error=0.005)
    assert found["perceived_pose_error=0 m"] == Perturbation()
    stored = perturbations_of(PICK + text)
    assert stored is not None and stored.wanted_success == 0.8


def test_every_axis_has_a_nominal_value_without_effect_and_a_documented_unit_and_range() -> None:
    assert {field.name for field in fields(Perturbation)} == AXES.keys()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in DOCUMENT.read_text().splitlines()]
    documented = {row[0]: row for row in rows if row}
    for axis in AXES.values():
        assert axis.description.endswith(".")
        assert axis.low <= axis.nominal <= axis.high
        assert getattr(Perturbation(), axis.name) == axis.nominal
        _, units, allowed, nominal, _ = documented[f"`{axis.name}`"]
        assert units.split(", ") == list(axis.units) and float(nominal) == axis.nominal
        low, high = (float(number) * list(axis.units.values())[-1] for number in re.findall(r"[\d.]+", allowed))
        assert (low, high) == (axis.low, axis.high)


def axis(text: str) -> str:
    return f"perturb:\n  axes:\n    {text}\n"


@pytest.mark.parametrize(
    ("text", "place", "reason"),
    [
        (
            axis("object_mas: {unit: factor, levels: [2]}"),
            "+3:5",
            "the axis 'object_mas' is unknown; allowed: object_mass",
        ),
        (axis("object_mas: {unit: factor, levels: [2]}"), "+3:5", "did you mean 'object_mass'?"),
        (axis("object_mass: {levels: [2]}"), "+3:18", "the axis object_mass has no unit; allowed: factor; add it"),
        (
            axis("object_mass: {unit: kg, levels: [2]}"),
            "+3:25",
            "the unit of object_mass 'kg' is unknown; allowed: factor",
        ),
        (
            axis("perceived_pose_error: {unit: mm, levels: [0, 300]}"),
            "+3:50",
            "each level of perceived_pose_error [mm] must be a number from 0 to 200, found the number 300",
        ),
        (axis("object_mass: {unit: factor, range: [0, 2]}"), "+3:41", "must be a number from 0.01 to 100, found the"),
        (
            axis("object_mass: {unit: factor, range: [2, 1]}"),
            "+3:40",
            "must be [LOW, HIGH] with LOW < HIGH, found [2.0",
        ),
        (axis("object_mass: {unit: factor}"), "+3:18", "has neither levels nor range"),
        (axis("object_mass: {unit: factor, levels: [2], range: [1, 2]}"), "+3:18", "has both levels and range"),
        (axis("object_mass: {unit: factor, levels: [2, 2]}"), "+3:45", "has the level 2 twice"),
        (axis("object_mass: {unit: factor, levels: [1]}"), "+3:18", "has only its nominal level 1"),
        (axis("object_mass: {unit: factor, levels: [2], steps: 3}"), "+3:53", "steps of object_mass belongs to range"),
        ("perturb: {axes: {}}\n", "+1:10", "perturb has no axes; allowed: object_mass, object_friction"),
        ("perturb: {}\n", "+1:10", "perturb has no axes"),
        ("perturb: {axis: {object_mass: {unit: factor, levels: [2]}}}\n", "+1:11", "did you mean 'axes'?"),
        (
            "perturb: {design: sobl, axes: {object_mass: {unit: factor, range: [1, 2]}}}\n",
            "+1:19",
            "did you mean 'sobol'",
        ),
        (SOBOL.replace("8", "9"), "+4:11", "must be a power of two, found 9; write 8 or 16"),
        (SOBOL.replace("range: [0, 30]", "levels: [0, 30]"), "+6:46", "the design sobol needs a range of perceived"),
        (AXES_TEXT + "  points: 8\n", "+6:11", "points belongs to a space-filling design"),
        (AXES_TEXT + "  wanted_success: 2\n", "+6:19", "wanted_success must be a number from 0.01 to 0.99"),
    ],
)
def test_a_wrong_perturbation_is_refused_with_its_place(text: str, place: str, reason: str, tmp_path: Path) -> None:
    line, column = place.removeprefix("+").split(":")
    first = len(PICK.splitlines())
    found = faults_of(PICK + text, tmp_path)
    assert any(one.startswith(f"{first + int(line)}:{column}: ") and reason in one for one in found), found


def test_perturbations_that_nothing_could_apply_are_refused(tmp_path: Path) -> None:
    head, _, tail = PICK.partition("objects:")
    without = head + tail[tail.index("success:") :]
    text = without.replace("success: {lifted: 0.1}\n", "").replace("  object: [cube, ball]\n", "") + AXES_TEXT
    assert any("there are no objects to perturb" in one for one in faults_of(text, tmp_path))
    reserved = PICK.replace("  object: [cube, ball]", "  object: [cube, ball]\n  perturbation: [a, b]")
    assert any("the factor 'perturbation' is reserved" in one for one in faults_of(reserved + AXES_TEXT, tmp_path))
    level = "    above: {perturbation: {object_mass: 2}, arguments:"
    twice = PICK.replace("    above: {arguments:", level)
    assert any(
        "sets perturbation.object_mass, which factor 'method' sets too" in one
        for one in faults_of(twice + AXES_TEXT, tmp_path)
    )
    planning = "mode: planning\nrobot: some_moveit_config\nproblems: p\nplanner: $p\n"
    planning += "experiment: a\nfactors: {p: [A, B]}\ncompare: p\n"
    assert any(
        "perturb needs the mode task, found planning" in one for one in faults_of(planning + AXES_TEXT, tmp_path)
    )
    compared = PICK.replace("compare: method", "compare: perturbation")
    assert any("compare 'perturbation' is unknown" in one for one in faults_of(compared + AXES_TEXT, tmp_path))


def test_a_level_of_a_factor_can_set_a_perturbation_in_si_units(tmp_path: Path) -> None:
    factor = "  object: [cube, ball]\n  load: {light: {}, heavy: {perturbation: {object_mass: 4}}}\n"
    experiment = read(PICK.replace("  object: [cube, ball]\n", factor), tmp_path)
    found = {one.configuration["load"]: one.settings.perturbation for one in experiment.combinations}
    assert found == {"light": None, "heavy": Perturbation(object_mass=4.0)}
    wrong = PICK + "perturbation: {object_mass: 1000}\n"
    assert any("object_mass must be a number from 0.01 to 100" in one for one in faults_of(wrong, tmp_path))
