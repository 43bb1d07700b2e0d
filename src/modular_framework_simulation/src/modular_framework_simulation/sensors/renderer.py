# SPDX-License-Identifier: BSD-3-Clause
"""Renders camera images with PyBullet in a separate engine without physics."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from enum import Enum
from typing import Any

import numpy as np

from modular_framework_simulation.errors import DescriptionError, SimulationError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.visual_meshes import VisualMeshes
from modular_framework_simulation.physics.pybullet_engine import load_pybullet
from modular_framework_simulation.sensors.cameras import CameraImage, Pinhole
from modular_framework_simulation.sensors.visible_scene import SceneUpdate
from modular_framework_urdf.rotations import rotate_vector

_PLANE_THICKNESS_M = 1e-3

_TINY_SHIFT = (-0.5, 0.5)
"""Shift of TinyRenderer's images to the right and down [pixel]; TinyRenderer samples pixels at a corner."""

_OPENGL_IN_OPTICAL = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
"""Pose of OpenGL's camera frame in the optical frame; OpenGL's camera looks along -z, with y up."""


class Drawing(Enum):
    """Renderers of PyBullet that work without a window."""

    EGL = "opengl"  # OpenGL through EGL, also without a graphics card
    TINY = "tiny"  # TinyRenderer on the CPU


class Renderer:
    """Renders visual shapes at their poses.

    Args:
        drawing: Renderer of PyBullet.
        meshes: Converter of mesh files and textures.
        log: Function that logs a shape that cannot be drawn.

    Raises:
        SimulationError: The renderer does not work on this machine.
    """

    def __init__(self, drawing: Drawing, meshes: VisualMeshes, log: Callable[[str], None]) -> None:
        self._api: Any = load_pybullet()
        self._meshes, self._log = meshes, log
        self._client: int = self._api.connect(self._api.DIRECT)
        self._flag, self._shift = self._api.ER_TINY_RENDERER, _TINY_SHIFT
        if drawing is Drawing.EGL:
            self._load_egl()
        self._bodies: dict[int, tuple[tuple[tuple[int, Pose], ...], ...]] = {}
        self._poses: dict[int, tuple[Pose, ...]] = {}

    def _load_egl(self) -> None:
        plugin = importlib.util.find_spec("eglRenderer")
        if plugin is None or plugin.origin is None:
            raise SimulationError("PyBullet was built without the EGL renderer; use TinyRenderer")
        if self._api.loadPlugin(plugin.origin, "_eglRendererPlugin", physicsClientId=self._client) < 0:
            raise SimulationError("PyBullet cannot load the EGL renderer on this machine; use TinyRenderer")
        self._flag, self._shift = self._api.ER_BULLET_HARDWARE_OPENGL, (0.0, 0.0)

    def apply(self, update: SceneUpdate) -> None:
        """Applies the changes of an update to the shapes."""
        for number in update.removed:
            for link in self._bodies.pop(number):
                for body, _ in link:
                    self._api.removeBody(body, physicsClientId=self._client)
            self._poses.pop(number, None)
        for number, links in update.added.items():
            self._bodies[number] = tuple(tuple(self._add(link)) for link in links)
        for number, poses in update.poses.items():
            old_poses = self._poses.get(number, (None,) * len(poses))
            for link, pose, old in zip(self._bodies[number], poses, old_poses, strict=True):
                if pose != old:
                    self._place(link, pose)
            self._poses[number] = poses

    def _place(self, link: tuple[tuple[int, Pose], ...], link_in_world: Pose) -> None:
        for body, shape_in_link in link:
            shape_in_world = link_in_world @ shape_in_link
            self._api.resetBasePositionAndOrientation(
                body, shape_in_world.position, shape_in_world.quaternion, physicsClientId=self._client
            )

    def _add(self, visuals: tuple[specs.Visual, ...]) -> list[tuple[int, Pose]]:
        bodies = []
        for visual in visuals:
            try:
                for options, colour, part_pose in self._shapes(visual):
                    shape = self._api.createVisualShape(
                        **options, rgbaColor=colour, specularColor=(0.1, 0.1, 0.1), physicsClientId=self._client
                    )
                    body = self._api.createMultiBody(0, -1, shape, physicsClientId=self._client)
                    bodies.append((body, visual.pose @ part_pose))
            except (DescriptionError, self._api.error) as error:
                self._log(f"the visual '{visual.name}' is not drawn: {error}")
        return bodies

    def _shapes(self, visual: specs.Visual) -> list[tuple[dict[str, Any], specs.Colour, Pose]]:
        """Returns the engine's options, the colour and the pose of each part of a visual."""
        geometry = visual.geometry
        # The engine's own spheres are too coarse.
        if visual.texture is None and not isinstance(geometry, specs.Mesh | specs.Sphere):
            options, part_pose = self._shape(geometry)
            return [(options, visual.colour, part_pose)]
        parts = self._meshes.parts(visual)
        mesh = self._api.GEOM_MESH
        return [({"shapeType": mesh, "fileName": str(part.file)}, part.colour, Pose()) for part in parts]

    def _shape(self, geometry: specs.Box | specs.Cylinder | specs.Plane) -> tuple[dict[str, Any], Pose]:
        api = self._api
        match geometry:
            case specs.Box(size=(x, y, z)):
                return {"shapeType": api.GEOM_BOX, "halfExtents": (x / 2, y / 2, z / 2)}, Pose()
            case specs.Cylinder(radius=radius, length=length):
                return {"shapeType": api.GEOM_CYLINDER, "radius": radius, "length": length}, Pose()
            case specs.Plane(normal=normal, size=(x, y)):
                half = _PLANE_THICKNESS_M / 2
                rotation = _rotation_from_z(normal)
                nx, ny, nz = normal
                part_pose = Pose((-nx * half, -ny * half, -nz * half), rotation)
                return {"shapeType": api.GEOM_BOX, "halfExtents": (x / 2, y / 2, half)}, part_pose

    def image(self, pinhole: Pinhole, optical_in_world: Pose) -> CameraImage:
        """Renders the image of a camera.

        Args:
            pinhole: Projection of the image.
            optical_in_world: Pose of the optical frame in the world frame.
        """
        _, _, rgba, buffer, _ = self._api.getCameraImage(
            pinhole.width,
            pinhole.height,
            _view_matrix(optical_in_world),
            pinhole.opengl_projection(self._shift),
            shadow=0,
            renderer=self._flag,
            flags=self._api.ER_NO_SEGMENTATION_MASK,
            physicsClientId=self._client,
        )
        size = (pinhole.height, pinhole.width)
        rgb = np.ascontiguousarray(np.asarray(rgba, np.uint8).reshape(*size, 4)[..., :3])
        return CameraImage(rgb, pinhole.depth_from_buffer(np.asarray(buffer, np.float32).reshape(size)))

    def close(self) -> None:
        """Closes the engine; may be called twice."""
        if self._client >= 0:
            self._api.disconnect(physicsClientId=self._client)
            self._client = -1


def _rotation_from_z(normal: tuple[float, float, float]) -> tuple[float, float, float, float]:
    """Returns the shortest rotation from the z axis to a unit vector, as a quaternion xyzw."""
    x, y, z = normal
    if z < -1 + 1e-9:
        return (1.0, 0.0, 0.0, 0.0)
    norm = float(np.sqrt(2 * (1 + z)))
    return (-y / norm, x / norm, 0.0, norm / 2)


def _view_matrix(optical_in_world: Pose) -> list[float]:
    """Returns OpenGL's view matrix in column-major order."""
    world_in_camera = (optical_in_world @ _OPENGL_IN_OPTICAL).inverse()
    columns = [rotate_vector(world_in_camera.quaternion, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    return [value for column in columns for value in (*column, 0.0)] + [*world_in_camera.position, 1.0]
