# SPDX-License-Identifier: BSD-3-Clause
"""Finds motion planning problems in the layout of MotionBenchMaker: sceneNNNN.yaml beside requestNNNN.yaml."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_core.files.located_yaml import Node, Sequence


@dataclass(frozen=True, slots=True)
class Problem:
    """A motion planning problem.

    Attributes:
        name: FAMILY/NUMBER.
        scene: Absolute path of the file of the scene.
        request: Absolute path of the file of the request.
    """

    name: str
    scene: str
    request: str


NO_PROBLEM = Problem("", "", "")
"""Placeholder in a combination of levels; each trial then has its own problem."""


def read_problems(reading: Reading, node: Node, key: str) -> list[Problem]:
    """Returns the problems of one or several folders, sorted by name within a folder.

    Args:
        reading: Reader that collects faults.
        node: Path of a folder, or a list of paths.
        key: Key of the value.
    """
    problems: list[Problem] = []
    for item in node.items if isinstance(node, Sequence) else (node,):
        text = reading.text(item, key)
        if text is None:
            continue
        folder = reading.path(text)
        found = _problems_in(folder, item, reading) if folder.is_dir() else []
        if not folder.is_dir():
            reading.faults.add(item.location, f"there is no folder {folder}; name a folder of scene and request files")
        elif not found:
            reading.faults.add(
                item.location,
                f"{folder} contains no problems; allowed: sceneNNNN.yaml beside requestNNNN.yaml, at any depth",
            )
        problems += found
    if isinstance(node, Sequence) and not node.items:
        reading.faults.add(node.location, f"{key} is an empty list; name at least one folder")
    return problems


def _problems_in(folder: Path, item: Node, reading: Reading) -> list[Problem]:
    problems = []
    for scene in sorted(folder.rglob("scene*.yaml")):
        number = scene.stem.removeprefix("scene")
        request = scene.with_name(f"request{number}.yaml")
        if not request.is_file():
            reading.faults.add(
                item.location, f"{scene} has no {request.name} beside it; add the request, or remove the scene"
            )
            continue
        problems.append(Problem(f"{scene.parent.name}/{number}", str(scene), str(request)))
    return problems
