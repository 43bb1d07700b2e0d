# SPDX-License-Identifier: BSD-3-Clause
"""Chooses the fastest way to draw that works on this machine.

A graphics driver that does not work may end the process that tries it, so each way is tried in a process of its own:
`python3 -m modular_framework_simulation.sensors.drawing_choice EGL` prints the seconds that an image takes.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.visual_meshes import VisualMeshes
from modular_framework_simulation.sensors.cameras import Pinhole
from modular_framework_simulation.sensors.renderer import Drawing, Renderer
from modular_framework_simulation.sensors.visible_scene import SceneUpdate

_TIMEOUT_S = 60.0
_IMAGES = 4
"""The first ones load shapes into the graphics memory; the fastest counts."""


def fastest_drawing(log: Callable[[str], None]) -> Drawing:
    """Measures all ways to draw, and returns the one that takes the least time for an image.

    Args:
        log: Takes a line that names the choice and the times.
    """
    times = {drawing: _time_in_new_process(drawing) for drawing in Drawing}
    best = min(times, key=lambda drawing: times[drawing])
    if math.isinf(times[best]):
        best = Drawing.TINY  # its error, if there is one, is reported where it draws
    measured = ", ".join(
        f"{drawing.value} {'does not work here' if math.isinf(seconds) else f'{seconds * 1e3:.0f} ms'}"
        for drawing, seconds in times.items()
    )
    log(f"cameras are drawn by {best.value} (an image of 640 x 480 pixels: {measured})")
    return best


def image_time_s(drawing: Drawing) -> float:
    """Measures how long an image takes once everything is loaded [s].

    Raises:
        SimulationError: This machine cannot draw that way.
    """
    with tempfile.TemporaryDirectory() as folder:
        renderer = Renderer(drawing, VisualMeshes(Path(folder)), print)
        floor = specs.Visual("floor", Pose(), specs.Plane((0.0, 0.0, 1.0), (10.0, 10.0)), (0.8, 0.8, 0.8, 1.0))
        box = specs.Visual("box", Pose(), specs.Box((0.2, 0.2, 0.2)), (0.8, 0.1, 0.1, 1.0))
        renderer.apply(SceneUpdate(0, {1: ((floor, box),)}, (), {1: (Pose(),)}, {}))
        above_floor = Pose((0.0, 0.0, 1.5), (1.0, 0.0, 0.0, 0.0))
        fastest = math.inf
        for _ in range(_IMAGES):
            begun = time.perf_counter()
            renderer.image(Pinhole(), above_floor)
            fastest = min(fastest, time.perf_counter() - begun)
        renderer.close()
    return fastest


def _time_in_new_process(drawing: Drawing) -> float:
    command = [sys.executable, "-m", __name__, drawing.name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT_S)
        return float(done.stdout) if done.returncode == 0 else math.inf
    except (subprocess.TimeoutExpired, ValueError):
        return math.inf


def main() -> int:
    """Prints the time of an image [s]; argument: the name of a `Drawing`.

    Returns:
        Exit code: 0.
    """
    # The engine and graphics drivers write to the standard output.
    answer = os.dup(1)
    os.dup2(2, 1)
    seconds = image_time_s(Drawing[sys.argv[1]])
    os.write(answer, f"{seconds:.6f}\n".encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
