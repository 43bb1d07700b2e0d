# SPDX-License-Identifier: BSD-3-Clause
"""MuJoCo as the physics engine; its model is recompiled for each added or removed body, and all motion continues."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np
import numpy.typing as npt

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.mujoco_bodies import (
    BodyTree,
    SpecWriter,
    body_name,
    joint_name,
    read_tree,
    wxyz,
)
from modular_framework_simulation.physics.mujoco_dynamics import MujocoDynamics, SavedDynamics
from modular_framework_simulation.physics.physics_engine import (
    BASE_INDEX,
    MAX_SHOWN_CHARACTERS,
    EngineContact,
    EngineJoint,
    JointKind,
    JointState,
    LinkContact,
    LinkMotion,
    Log,
    MassProperties,
    PhysicsEngine,
    Surface,
    refuse_long_names,
)
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.surfaces import softness_of
from modular_framework_urdf.rotations import Quaternion, Vector3, rotate_vector

_WIDTHS = {JointKind.FIXED: (0, 0), JointKind.BALL: (4, 3)}
"""Numbers of positions and velocities per joint type; 1 for other types."""


@dataclass(frozen=True, slots=True)
class _Span:
    """Slices of a joint's positions and velocities in the state vectors."""

    positions: slice
    dofs: slice


@dataclass(slots=True)
class _Body:
    """Body in the model.

    Attributes:
        tree: Links of the body.
        pose: Pose of the root's centre of mass in the world frame, for a fixed body.
        colliding: Pairs of the body's links that collide with each other.
        surfaces: Surfaces by link index.
        ids: MuJoCo's body ids of the root and of the links.
        spans: State slices of the root's free joint and of the joints.
    """

    tree: BodyTree
    pose: Pose = field(default_factory=Pose)
    colliding: frozenset[frozenset[int]] = frozenset()
    surfaces: dict[int, Surface] = field(default_factory=dict)
    ids: list[int] = field(default_factory=list)
    spans: list[_Span] = field(default_factory=list)

    @property
    def is_static(self) -> bool:
        """Whether no link of the body can move."""
        joints = (link.joint for link in self.tree.links if link.joint is not None)
        return self.tree.fixed and all(joint.kind is JointKind.FIXED for joint in joints)


@dataclass(frozen=True, slots=True)
class _Weld:
    """Weld between a link, given by body id and link index, and another body."""

    number: int
    index: int
    other: int
    other_in_link: Pose


@dataclass(frozen=True, slots=True)
class _State:
    """Saved state.

    Attributes:
        poses: Poses of the fixed bodies, by body id.
        dynamics: State of all moving bodies.
    """

    poses: dict[int, Pose]
    dynamics: SavedDynamics


class MujocoEngine(PhysicsEngine):
    """Empty MuJoCo engine.

    Args:
        settings: Settings of the physics engine.
        gravity: Gravity vector in the world frame [m/s^2].
        gui: Whether a window was requested; MuJoCo has no window, which is logged.
        log: Function that logs deviations from a description.
    """

    name = "mujoco"
    has_window = False
    takes_concave_meshes = False

    def __init__(self, settings: PhysicsSettings, gravity: Vector3, gui: bool, log: Log) -> None:
        if gui:
            log("the physics engine mujoco has no window: running headless")
        self.settings, self._gravity, self._log = settings, gravity, log
        self._bodies: dict[int, _Body] = {}
        self._last_number = self._last_weld = -1
        self._welds: dict[int, _Weld] = {}
        self._dynamics = MujocoDynamics(mujoco.MjSpec().compile(), settings, gravity)
        self._body_id_of = np.full(1, -1)
        self._static: frozenset[int] = frozenset()

    def adjust(self, settings: PhysicsSettings, gravity: Vector3) -> None:
        """Changes settings and gravity [m/s^2]."""
        self.settings, self._gravity = settings, gravity
        self._dynamics.adjust(settings, gravity)

    def restart(self, gravity: Vector3) -> None:
        """Removes all bodies."""
        self._gravity = gravity
        self._bodies, self._welds = {}, {}
        self._compile(self._bodies)

    def step(self) -> None:
        """Advances the physics by one time step."""
        self._dynamics.step()

    def resting(self) -> Collection[int]:
        """Returns the static bodies; MuJoCo computes all movable bodies in every step."""
        return self._static

    def motionless(self) -> Collection[int]:
        """Returns the static bodies."""
        return self._static

    def close(self) -> None:
        """Does nothing, because Python frees MuJoCo's memory with this object."""

    # Bodies

    def load_urdf(self, text: str, name: str, fixed: bool, self_collision: bool = False) -> int:
        """Loads a body; see `PhysicsEngine`."""
        refuse_long_names(text, f"model '{name[:MAX_SHOWN_CHARACTERS]}'")
        tree = read_tree(text, name, fixed, self._log)
        number = self._last_number + 1
        indices = range(BASE_INDEX, len(tree.links) - 1)
        colliding = frozenset(frozenset((a, b)) for a in indices for b in indices if a < b and self_collision)
        try:
            self._compile(self._bodies | {number: _Body(tree, tree.links[0].mass.centre_in_link, colliding)})
        except ValueError as error:
            problem = f"is rejected by the physics engine mujoco ({' '.join(str(error).split())})"
            raise DescriptionError(f"model '{name}'", problem, "check its shapes, masses and joints") from error
        self._last_number = number
        return number

    def _compile(self, bodies: dict[int, _Body]) -> None:
        """Compiles MuJoCo's model of bodies; the motion of existing bodies continues.

        Raises:
            ValueError: MuJoCo rejects a body; nothing has changed.
        """
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        writer = SpecWriter(spec)
        for number, body in bodies.items():
            writer.add(number, body.tree, body.pose, body.colliding)
        for weld in self._welds.values():
            writer.weld(weld.number, weld.index, weld.other, weld.other_in_link)
        old, new = self._dynamics, MujocoDynamics(spec.compile(), self.settings, self._gravity)
        new.measures_loads = old.measures_loads and bool(bodies)
        self._body_id_of = np.full(new.model.nbody, -1)
        for number, body in bodies.items():
            ids, spans = _ids_and_spans(new.model, number, body.tree)
            if body.ids:
                _copy_motion(old, body, new, ids, spans)
            body.ids, body.spans = ids, spans
            self._body_id_of[ids] = number
        self._dynamics, self._bodies = new, bodies
        self._static = frozenset(number for number, body in bodies.items() if body.is_static)
        for body in bodies.values():
            for index, surface in body.surfaces.items():
                self._write_surface(body, index, surface)

    def remove_body(self, number: int) -> None:
        """Removes a body."""
        self._compile({each: body for each, body in self._bodies.items() if each != number})

    def root_link(self, number: int) -> str:
        """Returns the name of the root link."""
        return self._bodies[number].tree.links[0].name

    def joints(self, number: int) -> list[EngineJoint]:
        """Returns all joints of a body."""
        return [link.joint for link in self._bodies[number].tree.links if link.joint is not None]

    def mass_properties(self, number: int, index: int) -> MassProperties:
        """Returns the mass properties of a link."""
        return self._bodies[number].tree.links[index + 1].mass

    def mass_matrix(self, number: int, indices: Sequence[int]) -> npt.NDArray[np.float64]:
        """Returns the joint space inertia matrix; see `PhysicsEngine`."""
        model, data, body = self._dynamics.model, self._dynamics.data, self._bodies[number]
        self._dynamics.update_kinematics()
        mujoco.mj_makeM(model, data)
        matrix = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, matrix)
        spans = [body.spans[0], *(body.spans[index + 1] for index in indices)]
        dofs = [dof for span in spans for dof in range(span.dofs.start, span.dofs.stop)]
        return matrix[np.ix_(dofs, dofs)]

    def set_self_collisions(self, number: int, allowed: Collection[frozenset[int]]) -> None:
        """Sets the pairs of links that collide."""
        self._bodies[number].colliding = frozenset(allowed)
        self._compile(self._bodies)

    def set_surface(self, number: int, index: int, surface: Surface, anchored: bool = False) -> None:
        """Sets friction, bounce and softness of a link; MuJoCo's friction does not need anchors."""
        del anchored
        body = self._bodies[number]
        body.surfaces[index] = surface
        self._write_surface(body, index, surface)

    def remove_margin(self, number: int, index: int) -> None:
        """Does nothing, because MuJoCo's shapes have no margin."""

    def remove_velocity_damping(self, number: int) -> None:
        """Does nothing, because MuJoCo does not damp velocities."""

    def _write_surface(self, body: _Body, index: int, surface: Surface) -> None:
        shapes = self._dynamics.model.geom_bodyid == body.ids[index + 1]
        compliance = correction = 0.0
        if (softness := softness_of(surface, self.settings)) is not None:
            kp, kd = softness
            stiffness_step = kp * self.settings.time_step_s
            compliance, correction = 1.0 / kp, stiffness_step / (stiffness_step + kd)
        row = (surface.lateral, surface.spinning, surface.rolling, surface.restitution, compliance, correction)
        self._dynamics.coefficients[shapes] = row

    # Motion

    def base_centre(self, number: int) -> Pose:
        """Returns the pose of the root link's centre of mass."""
        body = self._bodies[number]
        if body.tree.fixed:
            return body.pose
        values = self._dynamics.data.qpos[body.spans[0].positions].tolist()
        return Pose((values[0], values[1], values[2]), (values[4], values[5], values[6], values[3]))

    def base_twist(self, number: int) -> tuple[Vector3, Vector3]:
        """Returns linear and angular velocity of the root link's centre of mass."""
        body = self._bodies[number]
        if body.tree.fixed:
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        vx, vy, vz, wx, wy, wz = self._dynamics.data.qvel[body.spans[0].dofs].tolist()
        return (vx, vy, vz), rotate_vector(self.base_centre(number).quaternion, (wx, wy, wz))

    def set_base_centre(self, number: int, pose: Pose) -> None:
        """Sets the pose of the root link's centre of mass, with the root link at rest."""
        body, model, data = self._bodies[number], self._dynamics.model, self._dynamics.data
        if body.tree.fixed:
            body.pose = pose
            model.body_pos[body.ids[0]], model.body_quat[body.ids[0]] = pose.position, wxyz(pose.quaternion)
        else:
            data.qpos[body.spans[0].positions] = (*pose.position, *wxyz(pose.quaternion))
            data.qvel[body.spans[0].dofs] = 0.0
        self._dynamics.mark_moved()

    def set_base_twist(self, number: int, linear: Vector3, angular: Vector3) -> None:
        """Sets the velocity of the root link's centre of mass."""
        body = self._bodies[number]
        if not body.tree.fixed:
            angular_in_body = rotate_vector(self.base_centre(number).inverse().quaternion, angular)
            self._dynamics.data.qvel[body.spans[0].dofs] = (*linear, *angular_in_body)
            self._dynamics.mark_moved()

    def link_motion(self, number: int, index: int) -> LinkMotion:
        """Returns pose and velocity of a link."""
        self._dynamics.update_kinematics()
        model, data, body = self._dynamics.model, self._dynamics.data, self._bodies[number].ids[index + 1]
        frame = _pose(data.xpos[body], data.xquat[body])
        centre = frame @ _pose(model.body_ipos[body], model.body_iquat[body])
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        wx, wy, wz, vx, vy, vz = velocity.tolist()
        return LinkMotion(centre, frame, (vx, vy, vz), (wx, wy, wz))

    def weld(self, number: int, index: int, other: int) -> int:
        """Welds a body to a link; see `PhysicsEngine`."""
        self._dynamics.update_kinematics()
        data, link = self._dynamics.data, self._bodies[number].ids[index + 1]
        other_in_link = _pose(data.xpos[link], data.xquat[link]).inverse() @ self.base_centre(other)
        self._last_weld += 1
        self._welds[self._last_weld] = _Weld(number, index, other, other_in_link)
        self._compile(self._bodies)
        return self._last_weld

    def remove_weld(self, weld: int) -> None:
        """Removes a weld."""
        del self._welds[weld]
        self._compile(self._bodies)

    def apply_force(self, number: int, index: int, force: Sequence[float], point: Vector3) -> None:
        """Applies a force [N] at a point of a link [m] in the next step."""
        self._dynamics.update_kinematics()
        data, body = self._dynamics.data, self._bodies[number].ids[index + 1]
        data.xfrc_applied[body, :3] += force
        data.xfrc_applied[body, 3:] += np.cross(np.subtract(point, data.xipos[body]), force)

    def link_contacts(self, number: int, index: int) -> list[LinkContact]:
        """Returns the contacts of a link with other bodies."""
        bodies, forces, distances = self._dynamics.contacts()
        body_touches = []
        for row, side in np.argwhere(bodies == self._bodies[number].ids[index + 1]).tolist():
            other = int(self._body_id_of[bodies[row, 1 - side]])
            if other != number:
                body_touches.append(LinkContact(other, float(forces[row]), float(distances[row])))
        return body_touches

    def touched_bodies(self, number: int) -> set[int]:
        """Returns the bodies that a body presses on."""
        bodies, forces, _ = self._dynamics.contacts()
        sides = self._body_id_of[bodies[forces > 0.0]]
        return {int(side) for pair in sides if number in pair for side in pair if side not in (-1, number)}

    def contact_points(self, number: int, index: int) -> list[EngineContact]:
        """Returns the contact points of a link, with forces."""
        bodies, _, distances = self._dynamics.contacts()
        points = []
        for row, side in np.argwhere(bodies == self._bodies[number].ids[index + 1]).tolist():
            body, distance = int(bodies[row, 1 - side]), float(distances[row])
            other = int(self._body_id_of[body])
            position, normal, force = self._dynamics.contact(row)
            if other < 0 or (distance > 0.0 and not any(force)):
                continue
            link = list(self._bodies[other].ids).index(body) - 1
            sign = 1.0 if side else -1.0
            (nx, ny, nz), (fx, fy, fz) = ((sign * each).tolist() for each in (normal, force))
            points.append(EngineContact(other, link, position, (nx, ny, nz), distance, (fx, fy, fz)))
        return points

    # Joints

    def _span(self, number: int, index: int) -> _Span:
        return self._bodies[number].spans[index + 1]

    def joint_states(self, number: int, indices: Sequence[int]) -> list[JointState]:
        """Returns the states of joints."""
        spans, data = self._bodies[number].spans, self._dynamics.data
        positions = [spans[index + 1].positions.start for index in indices]
        dofs = [spans[index + 1].dofs.start for index in indices]
        columns = (data.qpos[positions], data.qvel[dofs], self._dynamics.motor_efforts[dofs])
        return [JointState(*row) for row in zip(*(column.tolist() for column in columns), strict=True)]

    def set_joint_state(self, number: int, index: int, position: float, velocity: float) -> None:
        """Sets position and velocity of a joint."""
        span, data = self._span(number, index), self._dynamics.data
        data.qpos[span.positions], data.qvel[span.dofs] = position, velocity
        self._dynamics.mark_moved()

    def ball_joint_state(self, number: int, index: int) -> tuple[Quaternion, Vector3]:
        """Returns rotation and angular velocity of a ball joint, the latter in the frame of the child link."""
        span, data = self._span(number, index), self._dynamics.data
        w, x, y, z = data.qpos[span.positions].tolist()
        rx, ry, rz = data.qvel[span.dofs].tolist()
        return (x, y, z, w), (rx, ry, rz)

    def set_ball_joint_state(self, number: int, index: int, rotation: Quaternion, rate: Vector3) -> None:
        """Sets rotation and angular velocity of a ball joint."""
        span, data = self._span(number, index), self._dynamics.data
        data.qpos[span.positions], data.qvel[span.dofs] = wxyz(rotation), rate
        self._dynamics.mark_moved()

    def release_ball_joint(self, number: int, index: int) -> None:
        """Does nothing, because MuJoCo's ball joints have no motor."""

    def set_joint_damping(self, number: int, index: int, damping: float) -> None:
        """Sets the viscous damping of a joint."""
        self._dynamics.model.dof_damping[self._span(number, index).dofs] = damping

    def set_position_motors(
        self,
        number: int,
        indices: Sequence[int],
        targets: Sequence[float],
        *,
        velocities: Sequence[float],
        efforts: Sequence[float],
        gain: float,
    ) -> None:
        """Sets motors that move joints to positions; see `PhysicsEngine`."""
        dofs = [self._span(number, index).dofs.start for index in indices]
        dynamics = self._dynamics
        dynamics.motor_targets[dofs], dynamics.motor_velocities[dofs] = targets, velocities
        dynamics.motor_gains[dofs], dynamics.model.dof_frictionloss[dofs] = gain, efforts

    def set_velocity_motor(self, number: int, index: int, velocity: float, effort: float) -> None:
        """Sets a motor that moves a joint at a velocity."""
        self.set_position_motors(number, [index], [0.0], velocities=[velocity], efforts=[effort], gain=0.0)

    def apply_effort(self, number: int, index: int, effort: float) -> None:
        """Applies an effort to a joint in the next step."""
        self._dynamics.data.qfrc_applied[self._span(number, index).dofs] += effort

    def measure_joint_load(self, number: int, index: int) -> None:
        """Enables the computation of the loads on all joints."""
        del number, index
        self._dynamics.measures_loads = True

    def joint_load(self, number: int, index: int) -> tuple[Vector3, Vector3]:
        """Returns the load of the child link on the parent link of a joint; see `PhysicsEngine`."""
        return self._dynamics.load(self._bodies[number].ids[index + 1])

    # Saved states

    def save_state(self) -> _State:
        """Returns a copy of the state."""
        poses = {number: body.pose for number, body in self._bodies.items()}
        return _State(poses, self._dynamics.state())

    def restore_state(self, state: _State) -> None:
        """Continues from a saved state; contacts are unknown until the next step."""
        for number, pose in state.poses.items():
            if self._bodies[number].tree.fixed:
                self.set_base_centre(number, pose)
        self._dynamics.set_state(state.dynamics)

    def forget_state(self, state: _State) -> None:
        """Does nothing, because a saved state is a copy."""


def _ids_and_spans(model: mujoco.MjModel, number: int, tree: BodyTree) -> tuple[list[int], list[_Span]]:
    """Returns MuJoCo's body ids of a body's links, and the state slices of its joints.

    Args:
        model: Compiled model.
        number: Id of the body.
        tree: Links of the body.
    """
    ids, spans = [], []
    for position, link in enumerate(tree.links):
        ids.append(model.body(body_name(number, position - 1)).id)
        free = link.joint is None and not tree.fixed
        kind = JointKind.FIXED if link.joint is None else link.joint.kind
        positions, dofs = (7, 6) if free else _WIDTHS.get(kind, (1, 1))
        begin = (0, 0)
        if dofs:
            joint = model.joint(joint_name(number, position - 1)).id
            begin = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        spans.append(_Span(slice(begin[0], begin[0] + positions), slice(begin[1], begin[1] + dofs)))
    return ids, spans


def _copy_motion(old: MujocoDynamics, body: _Body, new: MujocoDynamics, ids: list[int], spans: list[_Span]) -> None:
    """Copies the motion of a body from an old model to a new model.

    Args:
        old: Dynamics of the old model.
        body: The body in the old model.
        new: Dynamics of the new model.
        ids: Body ids in the new model.
        spans: State slices in the new model.
    """
    for old_span, new_span in zip(body.spans, spans, strict=True):
        new.data.qpos[new_span.positions] = old.data.qpos[old_span.positions]
        for target, source in zip(new.values_per_dof(), old.values_per_dof(), strict=True):
            target[new_span.dofs] = source[old_span.dofs]
    new.data.xfrc_applied[ids] = old.data.xfrc_applied[body.ids]


def _pose(position: npt.NDArray[np.float64], quaternion: npt.NDArray[np.float64]) -> Pose:
    px, py, pz = position.tolist()
    w, x, y, z = quaternion.tolist()
    return Pose((px, py, pz), (x, y, z, w))
