# SPDX-License-Identifier: BSD-3-Clause
"""Selects the camera renderer: OpenGL if it works on this machine, independent of the machine's load.

A faulty graphics driver may terminate the process that uses it, so a separate process tests OpenGL:
`python3 -m modular_framework_simulation.sensors.drawing_choice`.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.visual_meshes import VisualMeshes
from modular_framework_simulation.sensors.cameras import Pinhole
from modular_framework_simulation.sensors.renderer import Drawing, Renderer
from modular_framework_simulation.sensors.visible_scene import SceneUpdate

AUTO = "auto"
"""Value of the parameter that selects OpenGL if it works on this machine, and TinyRenderer otherwise."""
_TIMEOUT_S = 300.0
"""Timeout of the test [s]; even on a busy machine, only a hanging driver takes this long."""


def resolved_drawing(name: str) -> Drawing:
    """Returns the renderer for a value of the parameter ``~renderer``, always the same on the same machine."""
    if name != AUTO:
        return Drawing(name)
    return Drawing.EGL if _opengl_draws() else Drawing.TINY


def _opengl_draws() -> bool:
    try:
        return subprocess.run([sys.executable, "-m", __name__], capture_output=True, timeout=_TIMEOUT_S).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def main() -> int:
    """Renders a box on a floor with OpenGL.

    Returns:
        Exit code: 0 if the image contains the box, 1 otherwise.

    Raises:
        SimulationError: OpenGL cannot be loaded.
    """
    with tempfile.TemporaryDirectory() as folder:
        renderer = Renderer(Drawing.EGL, VisualMeshes(Path(folder)), print)
        floor = specs.Visual("floor", Pose(), specs.Plane((0.0, 0.0, 1.0), (10.0, 10.0)), (0.8, 0.8, 0.8, 1.0))
        box = specs.Visual("box", Pose(), specs.Box((0.2, 0.2, 0.2)), (0.8, 0.1, 0.1, 1.0))
        renderer.apply(SceneUpdate(0, {1: ((floor, box),)}, (), {1: (Pose(),)}, {}))
        pinhole = Pinhole()
        depth = renderer.image(pinhole, Pose((0.0, 0.0, 1.5), (1.0, 0.0, 0.0, 0.0))).depth
        renderer.close()
    return 0 if np.isclose(depth[pinhole.height // 2, pinhole.width // 2], 1.4, atol=0.01) else 1


if __name__ == "__main__":
    sys.exit(main())
