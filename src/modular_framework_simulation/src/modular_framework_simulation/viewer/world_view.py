# SPDX-License-Identifier: BSD-3-Clause
"""Draws the models of the simulated world."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from modular_framework_simulation.models.sdf_specs import Plane
from modular_framework_simulation.sensors.scene_text import ScenePoses, VisibleModel
from modular_framework_simulation.viewer.glb_files import bodies_of_visuals, glb_of
from modular_framework_simulation.viewer.layers import Layer, Look, tree_name

_FACTOR_WINDOW_S = 2.0


class WorldView:
    """The models of the world in a layer.

    Args:
        layer: Where they are drawn.
        log: Takes a line about a shape that cannot be drawn.
    """

    def __init__(self, layer: Layer, log: Callable[[str], None]) -> None:
        self._layer, self._log = layer, log
        self._paths: dict[int, tuple[str, ...]] = {}

    def show(self, models: Sequence[VisibleModel]) -> None:
        """Draws exactly these models; those that are drawn already stay as they are."""
        new = {model.number: model for model in models}
        for number in [number for number in self._paths if number not in new]:
            for path in self._paths.pop(number):
                self._layer.remove(path)
        for number, model in new.items():
            if number in self._paths:
                continue
            paths = []
            for link in model.links:
                path = f"{tree_name(model.name)}/{tree_name(link.name)}"
                is_ground = all(isinstance(visual.geometry, Plane) for visual in link.visuals)
                self._layer.add(
                    path,
                    glb_of(bodies_of_visuals(link.visuals, self._log)),
                    look=Look.GROUND if is_ground else Look.SOLID,
                )
                paths.append(path)
            self._paths[number] = tuple(paths)

    def place(self, poses: ScenePoses) -> None:
        """Puts the models where they are; models that are not drawn are left out."""
        for number, links in poses.poses.items():
            for path, pose in zip(self._paths.get(number, ()), links, strict=False):
                self._layer.place(path, pose)


class RealTimeFactor:
    """How fast simulated time runs, measured over the last seconds."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque()

    def note(self, now_s: float, time_ns: int) -> None:
        """Takes simulated time [ns] at an instant of real time [s]; time that goes back starts again."""
        if self._seen and time_ns < self._seen[-1][1]:
            self._seen.clear()
        self._seen.append((now_s, time_ns))
        while len(self._seen) > 2 and self._seen[1][0] < now_s - _FACTOR_WINDOW_S:
            self._seen.popleft()

    @property
    def value(self) -> float:
        """Simulated over real time; 0 where too little is known."""
        if len(self._seen) < 2:
            return 0.0
        (first_s, first_ns), (last_s, last_ns) = self._seen[0], self._seen[-1]
        return (last_ns - first_ns) * 1e-9 / max(last_s - first_s, 1e-9)
