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
    """Shows the models of the world in a layer.

    Args:
        layer: Layer of the models.
        log: Function that logs a shape that cannot be drawn.
    """

    def __init__(self, layer: Layer, log: Callable[[str], None]) -> None:
        self._layer, self._log = layer, log
        self._models: dict[int, VisibleModel] = {}
        self._paths: dict[int, tuple[str, ...]] = {}

    @property
    def is_empty(self) -> bool:
        """Returns whether no model is shown."""
        return not self._models

    def show(self, models: Sequence[VisibleModel]) -> None:
        """Shows exactly these models; models that are already shown are not changed.

        A restarted simulation gives the numbers of earlier models to other models.
        """
        shown = {model.number: model for model in models}
        for number in [number for number, model in self._models.items() if shown.get(number) != model]:
            del self._models[number]
            for path in self._paths.pop(number):
                self._layer.remove(path)
        for number, model in shown.items():
            if number in self._models:
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
            self._models[number], self._paths[number] = model, tuple(paths)

    def place(self, poses: ScenePoses) -> None:
        """Moves the models to their poses; models that are not shown are ignored."""
        for number, links in poses.poses.items():
            for path, pose in zip(self._paths.get(number, ()), links, strict=False):
                self._layer.place(path, pose)


class RealTimeFactor:
    """Measures the ratio of simulated to real time over the last seconds."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, int]] = deque()

    def note(self, now_s: float, time_ns: int) -> None:
        """Adds a sample of simulated time [ns] and real time [s]; decreasing simulated time resets the measurement."""
        if self._samples and time_ns < self._samples[-1][1]:
            self._samples.clear()
        self._samples.append((now_s, time_ns))
        while len(self._samples) > 2 and self._samples[1][0] < now_s - _FACTOR_WINDOW_S:
            self._samples.popleft()

    @property
    def value(self) -> float:
        """Returns the ratio of simulated to real time; 0 with less than two samples."""
        if len(self._samples) < 2:
            return 0.0
        (first_s, first_ns), (last_s, last_ns) = self._samples[0], self._samples[-1]
        return (last_ns - first_ns) * 1e-9 / max(last_s - first_s, 1e-9)
