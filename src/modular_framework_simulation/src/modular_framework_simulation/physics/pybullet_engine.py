# SPDX-License-Identifier: BSD-3-Clause
"""PyBullet as the default physics engine.

All calls must come from one thread, because PyBullet has global state.
"""

from __future__ import annotations

import contextlib
import math
import os
import tempfile
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from modular_framework_simulation.errors import DescriptionError, SimulationError
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.contact_rules import use_smaller_coefficients
from modular_framework_simulation.physics.cylinder_rims import with_rims
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
from modular_framework_simulation.physics.pybullet_rest import SleepingBodies
from modular_framework_simulation.physics.pybullet_store import BodyStore, link_motion
from modular_framework_simulation.physics.simulated_body import add, cross
from modular_framework_simulation.physics.surfaces import softness_of
from modular_framework_urdf import xml_text
from modular_framework_urdf.rotations import Quaternion, Vector3, rotate_vector

_RIGID_DAMPING = 1e9
"""Damping of a rigid contact [N s/m]; only the fraction of the correction matters."""

_ITERATIONS_PER_RATIO, _MAX_ITERATIONS = 2.0, 2000
"""Solver iterations per mass ratio of free bodies, and their maximum; at 1:1,000 the penetration is about 1 %."""

_MAX_VELOCITY = 1e3
"""Maximum velocity of bodies [m/s, rad/s]; the engine's default of 100 slows fast rotations down."""

_CONCAVE = 'concave="yes"'
"""Mark of a mesh that is kept exactly; the engine takes too long to load it again during the simulation."""

_WELD_FORCE = 1e5
"""Maximum force and torque of a weld [N, Nm], practically unlimited."""


@contextlib.contextmanager
def silenced_output() -> Iterator[None]:
    """Discards terminal output of the engine's C++ code; its errors are raised as exceptions."""
    saved = [(os.dup(number), number) for number in (1, 2)]
    try:
        with open(os.devnull, "w") as devnull:
            for _, number in saved:
                os.dup2(devnull.fileno(), number)
            yield
    finally:
        for copy, number in saved:
            os.dup2(copy, number)
            os.close(copy)


def load_pybullet() -> Any:
    """Imports the engine's module without its terminal output."""
    with silenced_output():
        import pybullet
    return pybullet


class PyBulletEngine(PhysicsEngine):
    """Empty PyBullet engine.

    Args:
        settings: Settings of the engine.
        gravity: Gravity vector in the world frame [m/s^2].
        gui: Whether to open a window; a missing display is logged.
        log: Function that logs a decision.
    """

    name = "pybullet"
    takes_concave_meshes = True

    def __init__(self, settings: PhysicsSettings, gravity: Vector3, gui: bool, log: Log) -> None:
        self.api: Any = load_pybullet()
        self.settings = settings
        self.client = -1
        self.has_window = False
        if gui:
            self._open_window(log)
        if self.client < 0:
            self.client = self.api.connect(self.api.DIRECT)
        if self.client < 0:
            raise SimulationError("the physics engine accepts no further connection; close another simulation first")
        self._uses_smaller_coefficients = use_smaller_coefficients(self.api)
        if not self._uses_smaller_coefficients:
            log(
                "this build of the physics engine multiplies friction and restitution coefficients, so a contact "
                "between different surfaces uses their geometric mean instead of the smaller coefficient"
            )
        self._forget_bodies()
        self._impossible_moments: dict[int, dict[int, list[float]]] = {}  # by body and link
        self._free_masses: dict[int, float] = {}  # masses of bodies without joints [kg]
        self._iterations_fit = True  # whether the solver iterations match the masses
        self._urdf_folder = tempfile.TemporaryDirectory(prefix="simulation_")
        self._files_written = 0
        self._configure(gravity)

    def _open_window(self, log: Log) -> None:
        if not os.environ.get("DISPLAY"):
            log("the requested window is not available, because no display is set: running headless")
            return
        try:
            self.client = self.api.connect(self.api.GUI)
        except self.api.error as error:
            log(f"the requested window could not be opened ({error}): running headless")
        self.has_window = self.client >= 0

    def _set_parameters(self, gravity: Vector3) -> None:
        settings = self.settings
        self.api.setGravity(*gravity, physicsClientId=self.client)
        self.api.setPhysicsEngineParameter(
            fixedTimeStep=settings.time_step_s,
            numSolverIterations=self._solver_iterations(),
            numSubSteps=0,
            contactERP=settings.contact_erp,
            frictionERP=settings.friction_erp,
            contactBreakingThreshold=settings.contact_reach,
            restitutionVelocityThreshold=settings.bounce_threshold,
            enableConeFriction=1,
            deterministicOverlappingPairs=1,
            physicsClientId=self.client,
        )

    def _solver_iterations(self) -> int:
        """Returns the number of solver iterations, which grows with the mass ratio of the free bodies."""
        masses = self._free_masses.values()
        ratio = max(masses) / min(masses) if masses else 1.0
        minimum = self.settings.solver_iterations
        return max(minimum, min(round(_ITERATIONS_PER_RATIO * ratio), _MAX_ITERATIONS))

    def _fit_iterations(self) -> None:
        self._iterations_fit = True
        self.api.setPhysicsEngineParameter(numSolverIterations=self._solver_iterations(), physicsClientId=self.client)

    def _configure(self, gravity: Vector3) -> None:
        self._set_parameters(gravity)
        if self.has_window:
            # Without a graphics card, side panels and shadows take longer than the physics.
            self.api.configureDebugVisualizer(self.api.COV_ENABLE_GUI, 0, physicsClientId=self.client)
            self.api.configureDebugVisualizer(self.api.COV_ENABLE_SHADOWS, 0, physicsClientId=self.client)
            distance_m, yaw_deg, pitch_deg, target = 1.8, 50.0, -30.0, (0.0, 0.4, 0.9)
            self.api.resetDebugVisualizerCamera(distance_m, yaw_deg, pitch_deg, target, physicsClientId=self.client)

    def adjust(self, settings: PhysicsSettings, gravity: Vector3) -> None:
        """Changes settings and gravity.

        Args:
            settings: Settings of the engine.
            gravity: Gravity vector in the world frame [m/s^2].
        """
        self.settings = settings
        self._set_parameters(gravity)
        self._rest.adjust(settings)

    def engine_coefficient(self, coefficient: float) -> float:
        """Converts a friction or restitution coefficient to the engine's value for a surface."""
        return coefficient if self._uses_smaller_coefficients else math.sqrt(coefficient)

    def restart(self, gravity: Vector3) -> None:
        """Removes all bodies, contacts and caches.

        Args:
            gravity: Gravity vector in the world frame [m/s^2].
        """
        self.api.resetSimulation(physicsClientId=self.client)
        self._impossible_moments.clear()
        self._free_masses.clear()
        self._forget_bodies()
        self._configure(gravity)

    def _forget_bodies(self) -> None:
        self._store = BodyStore(self.api, self.client, lambda text, fixed: self._load_text(text, fixed, 0))
        self._rest = SleepingBodies(self.api, self.client, self.settings, self._store)

    def load_urdf(self, text: str, name: str, fixed: bool, self_collision: bool = False) -> int:
        """Loads a body; see `PhysicsEngine`."""
        flags = self.api.URDF_USE_SELF_COLLISION if self_collision else 0
        text = with_rims(text, name)
        refuse_long_names(text, f"model '{name[:MAX_SHOWN_CHARACTERS]}'")
        try:
            body = self._store.add(self._load_text(text, fixed, flags))
        except self.api.error as error:
            problem = f"is rejected by the physics engine ({error})"
            raise DescriptionError(f"model '{name}'", problem, "check its shapes and joints") from error
        self._set_dropped_moments(body, text)
        infos = self.joint_infos(body)
        joints = [info[0] for info in infos if info[2] != self.api.JOINT_FIXED]
        is_robot = self_collision
        if not (is_robot or self.has_window or body in self._impossible_moments or _CONCAVE in text):
            self._store.keep_recipe(body, text, fixed, joints)
        self._rest.add(body, fixed, joints, is_robot)
        mass: float = self.api.getDynamicsInfo(self._id(body), BASE_INDEX, physicsClientId=self.client)[0]
        if not fixed and not joints and mass > 0.0:
            self._free_masses[body] = mass
            self._iterations_fit = False
        return body

    def _load_text(self, text: str, fixed: bool, flags: int) -> int:
        """Loads a URDF; returns the engine's id of the body."""
        # The engine caches files by name, so each body needs its own file.
        self._files_written += 1
        file = Path(self._urdf_folder.name) / f"body_{self._files_written}.urdf"
        file.write_text(text, encoding="utf-8")
        # A cylinder has 32 sides by default and rolls unevenly. SAT features allow boxes and hulls to have up to four
        # contact points at once instead of one.
        flags |= self.api.URDF_USE_IMPLICIT_CYLINDER | self.api.URDF_USE_INERTIA_FROM_FILE
        flags |= self.api.URDF_INITIALIZE_SAT_FEATURES
        with silenced_output():
            body: int = self.api.loadURDF(str(file), useFixedBase=fixed, flags=flags, physicsClientId=self.client)
        file.unlink()
        return body

    def _id(self, number: int) -> int:
        """Returns the engine's id of a body, which is loaded again if it is stored."""
        return self._rest.body_id(number)

    def _set_dropped_moments(self, body: int, text: str) -> None:
        """Sets moments of inertia that the loader replaced by 0, because no rigid body has them."""
        names = [self.root_link(body), *(joint.child_link for joint in self.joints(body))]
        dropped = {}
        for index, name in enumerate(names, BASE_INDEX):
            mass, _, moments, *_ = self.api.getDynamicsInfo(self._id(body), index, physicsClientId=self.client)
            if mass > 0.0 and not any(moments):
                dropped[name] = index
        for link in xml_text.parse(text, f"body {body}").findall("link") if dropped else ():
            inertia, number = link.find("inertial/inertia"), dropped.get(link.get("name", ""))
            if inertia is not None and number is not None:
                moments = [float(inertia.get(key, "0")) for key in ("ixx", "iyy", "izz")]
                self._impossible_moments.setdefault(body, {})[number] = moments
                self._set_moments(body, number, moments)

    def joint_infos(self, body: int) -> list[tuple[Any, ...]]:
        """Returns the engine's records of all joints of a body, sorted by index."""
        count = self.api.getNumJoints(self._id(body), physicsClientId=self.client)
        return [self.api.getJointInfo(self._id(body), index, physicsClientId=self.client) for index in range(count)]

    def step(self) -> None:
        """Advances the physics by one time step."""
        if not self._iterations_fit:
            self._fit_iterations()
        self._rest.before_step()
        self.api.stepSimulation(physicsClientId=self.client)
        self._rest.after_step()

    def close(self) -> None:
        """Closes the connection; may be called twice."""
        if self.client >= 0:
            with contextlib.suppress(self.api.error):
                self.api.disconnect(physicsClientId=self.client)
            self.client = -1
            self._urdf_folder.cleanup()

    def resting(self) -> Collection[int]:
        """Returns the sleeping bodies."""
        return self._rest.bodies_at_rest

    def motionless(self) -> Collection[int]:
        """Returns the static bodies and the stored bodies."""
        return self._rest.motionless_bodies

    def save_state(self) -> int:
        """Saves the state, contacts and caches in the engine.

        Raises:
            SimulationError: The settings allow bodies to sleep.
        """
        if self.settings.rest_speed > 0.0:
            raise SimulationError(
                "a world with sleeping bodies cannot be saved with bitwise identical results; set rest_speed to 0"
            )
        state: int = self.api.saveState(physicsClientId=self.client)
        return state

    def restore_state(self, state: int) -> None:
        """Continues from a saved state."""
        self.api.restoreState(state, physicsClientId=self.client)

    def forget_state(self, state: int) -> None:
        """Deletes a saved state."""
        self.api.removeState(state, physicsClientId=self.client)

    def remove_body(self, number: int) -> None:
        """Removes a body."""
        self._rest.wake_touching(number)
        body = self._id(number)
        self._rest.remove(number)
        self._impossible_moments.pop(number, None)
        self.api.removeBody(body, physicsClientId=self.client)
        self._store.remove(number)
        if self._free_masses.pop(number, None) is not None:
            self._iterations_fit = False

    def root_link(self, number: int) -> str:
        """Returns the name of the root link."""
        name: str = self.api.getBodyInfo(self._id(number), physicsClientId=self.client)[0].decode()
        return name

    def joints(self, number: int) -> list[EngineJoint]:
        """Returns all joints of a body."""
        return [self._joint(info) for info in self.joint_infos(number)]

    def _joint(self, info: tuple[Any, ...]) -> EngineJoint:
        kinds = {
            self.api.JOINT_REVOLUTE: JointKind.REVOLUTE,
            self.api.JOINT_PRISMATIC: JointKind.PRISMATIC,
            self.api.JOINT_SPHERICAL: JointKind.BALL,
            self.api.JOINT_FIXED: JointKind.FIXED,
        }
        lower, upper = info[8], info[9]
        if lower > upper:  # the engine's encoding of no limits
            lower, upper = -math.inf, math.inf
        kind = kinds.get(info[2], JointKind.OTHER)
        return EngineJoint(
            index=info[0],
            name=info[1].decode(),
            child_link=info[12].decode(),
            kind=kind,
            lower=lower,
            upper=upper,
            damping=info[6],
            friction=info[7],
        )

    def mass_properties(self, number: int, index: int) -> MassProperties:
        """Returns the mass properties of a link."""
        record = self.api.getDynamicsInfo(self._id(number), index, physicsClientId=self.client)
        return MassProperties(record[0], record[2], Pose(tuple(record[3]), tuple(record[4])))

    def mass_matrix(self, number: int, indices: Sequence[int]) -> npt.NDArray[np.float64]:
        """Returns the joint space inertia matrix; see `PhysicsEngine`."""
        states = self.api.getJointStates(self._id(number), indices, physicsClientId=self.client)
        positions = [state[0] for state in states]
        # The engine rejects moments that no rigid body has; their mean is used instead.
        impossible = self._impossible_moments.get(number, {})
        for index, moments in impossible.items():
            self._set_moments(number, index, [sum(moments) / 3.0] * 3)
        matrix = np.array(self.api.calculateMassMatrix(self._id(number), positions, physicsClientId=self.client))
        for index, moments in impossible.items():
            self._set_moments(number, index, moments)
        return matrix

    def _set_moments(self, number: int, index: int, moments: Sequence[float]) -> None:
        self._set_dynamics(number, index, localInertiaDiagonal=moments)

    def set_self_collisions(self, number: int, allowed: Collection[frozenset[int]]) -> None:
        """Sets the pairs of links that collide."""
        body = self._id(number)
        every = range(BASE_INDEX, self.api.getNumJoints(body, physicsClientId=self.client))
        for a in every:
            for b in range(a + 1, every.stop):
                enable = int(frozenset((a, b)) in allowed)
                self.api.setCollisionFilterPair(body, body, a, b, enable, physicsClientId=self.client)

    def set_surface(self, number: int, index: int, surface: Surface, anchored: bool = False) -> None:
        """Sets friction, bounce and softness of a link."""
        options: dict[str, float] = {}
        softness = self._softness(surface)
        if softness is not None:
            options["contactStiffness"], options["contactDamping"] = softness
        if surface.restitution > 0.0:
            # Otherwise, the engine slows a body down just before the contact, which changes the impact velocity.
            options["contactProcessingThreshold"] = 0.0
        self._set_dynamics(
            number,
            index,
            lateralFriction=self.engine_coefficient(surface.lateral),
            spinningFriction=surface.spinning,
            rollingFriction=surface.rolling,
            restitution=self.engine_coefficient(surface.restitution),
            frictionAnchor=int(anchored),
            **options,
        )

    def _softness(self, surface: Surface) -> tuple[float, float] | None:
        """Returns stiffness [N/m] and damping [N s/m] of a contact, or None for the engine's default."""
        settings, step_s = self.settings, self.settings.time_step_s
        if surface.restitution > 0.0:
            erp = settings.bounce_erp
            return erp / (1.0 - erp) * _RIGID_DAMPING / step_s, _RIGID_DAMPING
        return softness_of(surface, settings)

    def remove_margin(self, number: int, index: int) -> None:
        """Removes the collision margin, with which cylinders and meshes float a millimetre above a table."""
        self._set_dynamics(number, index, collisionMargin=0.0)

    def remove_velocity_damping(self, number: int) -> None:
        """Removes the engine's default velocity damping of 4 % per second."""
        self._set_dynamics(number, BASE_INDEX, linearDamping=0.0, angularDamping=0.0, maxJointVelocity=_MAX_VELOCITY)

    def _set_dynamics(self, number: int, index: int, **options: Any) -> None:
        self._store.note_options(number, index, options)
        self.api.changeDynamics(self._id(number), index, **options, physicsClientId=self.client)

    def base_centre(self, number: int) -> Pose:
        """Returns the pose of the root link's centre of mass."""
        stored = self._store.stored.get(number)
        if stored is not None:
            return stored.centre
        return Pose(*self.api.getBasePositionAndOrientation(self._id(number), physicsClientId=self.client))

    def base_twist(self, number: int) -> tuple[Vector3, Vector3]:
        """Returns linear and angular velocity of the root link's centre of mass."""
        if number in self._store.stored:
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        linear, angular = self.api.getBaseVelocity(self._id(number), physicsClientId=self.client)
        return linear, angular

    def set_base_centre(self, number: int, pose: Pose) -> None:
        """Sets the pose of the root link's centre of mass, with the root link at rest."""
        self._rest.wake_touching(number)
        self._rest.wake(number)
        self.api.resetBasePositionAndOrientation(
            self._id(number), pose.position, pose.quaternion, physicsClientId=self.client
        )
        self._rest.wake_near(number)

    def set_base_twist(self, number: int, linear: Vector3, angular: Vector3) -> None:
        """Sets the velocity of the root link's centre of mass."""

        def set_velocity() -> None:
            self.api.resetBaseVelocity(self._id(number), linear, angular, physicsClientId=self.client)

        self._rest.disturb(number, set_velocity)

    def link_motion(self, number: int, index: int) -> LinkMotion:
        """Returns pose and velocity of a link."""
        stored = self._store.stored.get(number)
        if stored is not None:
            return stored.links[index]
        return link_motion(self.api.getLinkState(self._id(number), index, 1, 1, physicsClientId=self.client))

    def weld(self, number: int, index: int, other: int) -> int:
        """Welds a body to a link; see `PhysicsEngine`."""
        link = self.base_centre(number) if index == BASE_INDEX else self.link_motion(number, index).centre
        other_in_link = link.inverse() @ self.base_centre(other)
        weld: int = self.api.createConstraint(
            self._id(number),
            index,
            self._id(other),
            BASE_INDEX,
            self.api.JOINT_FIXED,
            (0.0, 0.0, 0.0),
            other_in_link.position,
            (0.0, 0.0, 0.0),
            other_in_link.quaternion,
            physicsClientId=self.client,
        )
        self.api.changeConstraint(weld, maxForce=_WELD_FORCE, physicsClientId=self.client)
        return weld

    def remove_weld(self, weld: int) -> None:
        """Removes a weld."""
        self.api.removeConstraint(weld, physicsClientId=self.client)

    def apply_force(self, number: int, index: int, force: Sequence[float], point: Vector3) -> None:
        """Applies a force [N] at a point of a link [m] in the next step."""

        def apply() -> None:
            self.api.applyExternalForce(
                self._id(number), index, force, point, self.api.WORLD_FRAME, physicsClientId=self.client
            )

        self._rest.disturb(number, apply)

    def link_contacts(self, number: int, index: int) -> list[LinkContact]:
        """Returns the contacts of a link with other bodies."""
        touches = [
            LinkContact(self._store.number(point[2]), point[9], point[8]) for point in self._contacts(number, index)
        ]
        return [touch for touch in touches if touch.other != number]

    def touched_bodies(self, number: int) -> set[int]:
        """Returns the bodies that a body presses on; none for a stored body."""
        if number in self._store.stored:
            return set()
        points = self.api.getContactPoints(bodyA=self._id(number), physicsClientId=self.client)
        return {self._store.number(point[2]) for point in points if point[9] > 0.0} - {number}

    def contact_points(self, number: int, index: int) -> list[EngineContact]:
        """Returns the contact points of a link, with forces."""
        records = [record for record in self._contacts(number, index) if record[9] > 0.0 or record[8] <= 0.0]
        return [_contact(record, self._store.number(record[2])) for record in records]

    def _contacts(self, number: int, index: int) -> tuple[tuple[Any, ...], ...]:
        """Returns the engine's records of the contact points of a link, whose neighbours are not stored any more."""
        self._rest.watch(number)
        records: tuple[tuple[Any, ...], ...] = self.api.getContactPoints(
            bodyA=self._id(number), linkIndexA=index, physicsClientId=self.client
        )
        return records

    def joint_states(self, number: int, indices: Sequence[int]) -> list[JointState]:
        """Returns the states of joints."""
        stored = self._store.stored.get(number)
        if stored is not None:
            return [JointState(stored.joints[index][0], 0.0, 0.0) for index in indices]
        records = self.api.getJointStates(self._id(number), indices, physicsClientId=self.client)
        return [JointState(record[0], record[1], record[3]) for record in records]

    def set_joint_state(self, number: int, index: int, position: float, velocity: float) -> None:
        """Sets position and velocity of a joint."""
        self._rest.wake_touching(number)

        def set_state() -> None:
            self.api.resetJointState(self._id(number), index, position, velocity, physicsClientId=self.client)

        self._rest.disturb(number, set_state)

    def ball_joint_state(self, number: int, index: int) -> tuple[Quaternion, Vector3]:
        """Returns rotation and angular velocity of a ball joint."""
        stored = self._store.stored.get(number)
        if stored is not None:
            x, y, z, w = stored.joints[index]
            return (x, y, z, w), (0.0, 0.0, 0.0)
        rotation, rate = self.api.getJointStateMultiDof(self._id(number), index, physicsClientId=self.client)[:2]
        return rotation, rate

    def set_ball_joint_state(self, number: int, index: int, rotation: Quaternion, rate: Vector3) -> None:
        """Sets rotation and angular velocity of a ball joint."""
        self._rest.wake_touching(number)

        def set_state() -> None:
            self.api.resetJointStateMultiDof(self._id(number), index, rotation, rate, physicsClientId=self.client)

        self._rest.disturb(number, set_state)

    def release_ball_joint(self, number: int, index: int) -> None:
        """Removes the engine's default motor of a ball joint."""

        def release() -> None:
            self.api.setJointMotorControlMultiDof(
                self._id(number),
                index,
                self.api.POSITION_CONTROL,
                targetPosition=[0.0, 0.0, 0.0, 1.0],
                positionGain=0.0,
                velocityGain=0.0,
                force=[0.0, 0.0, 0.0],
                physicsClientId=self.client,
            )

        self._set_motor(number, index, release)

    def _set_motor(self, number: int, index: int, setting: Callable[[], None]) -> None:
        """Applies the setting of a joint motor, which also applies after the body was stored."""
        self._rest.wake(number)
        self._store.note_motor(number, index, setting)
        setting()

    def set_joint_damping(self, number: int, index: int, damping: float) -> None:
        """Sets the viscous damping of a joint."""
        self._set_dynamics(number, index, jointDamping=damping)

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
        self.api.setJointMotorControlArray(
            self._id(number),
            indices,
            self.api.POSITION_CONTROL,
            targetPositions=targets,
            targetVelocities=velocities,
            forces=efforts,
            positionGains=[gain] * len(indices),
            velocityGains=[1.0] * len(indices),
            physicsClientId=self.client,
        )

    def set_velocity_motor(self, number: int, index: int, velocity: float, effort: float) -> None:
        """Sets a motor that moves a joint at a velocity."""

        def set_velocity() -> None:
            self.api.setJointMotorControl2(
                self._id(number),
                index,
                self.api.VELOCITY_CONTROL,
                targetVelocity=velocity,
                velocityGain=1.0,
                force=effort,
                physicsClientId=self.client,
            )

        self._set_motor(number, index, set_velocity)

    def apply_effort(self, number: int, index: int, effort: float) -> None:
        """Applies an effort to a joint in the next step."""

        def apply() -> None:
            self.api.setJointMotorControl2(
                self._id(number), index, self.api.TORQUE_CONTROL, force=effort, physicsClientId=self.client
            )

        self._rest.disturb(number, apply)

    def measure_joint_load(self, number: int, index: int) -> None:
        """Enables the measurement of the load on a joint."""
        self._rest.keep_awake(number)
        self.api.enableJointForceTorqueSensor(self._id(number), index, True, physicsClientId=self.client)

    def joint_load(self, number: int, index: int) -> tuple[Vector3, Vector3]:
        """Returns the load of the child link on the parent link of a joint; see `PhysicsEngine`.

        The engine measures the load of the parent link on the child link, at the centre of mass and in the inertia
        frame of the child link, without the effort of the motor along the joint axis.
        """
        info = self.api.getJointInfo(self._id(number), index, physicsClientId=self.client)
        _, _, reaction, motor = self.api.getJointState(self._id(number), index, physicsClientId=self.client)
        record = self.api.getLinkState(self._id(number), index, physicsClientId=self.client)
        centre_in_link = Pose(record[2], record[3])
        x, y, z = info[13]  # axis in the inertia frame of the link
        along_axis = (motor * x, motor * y, motor * z)
        force, torque = reaction[:3], reaction[3:]
        if info[2] == self.api.JOINT_REVOLUTE:
            torque = add(torque, along_axis)
        force, torque = (rotate_vector(centre_in_link.quaternion, each) for each in (force, torque))
        about_origin = add(torque, cross(centre_in_link.position, force))
        return _negative(force), _negative(about_origin)


def _contact(record: tuple[Any, ...], other: int) -> EngineContact:
    """Converts a record of the engine's contact points.

    Args:
        record: The engine's record.
        other: Number of the other body.
    """
    on_first, on_other, (nx, ny, nz) = record[5], record[6], record[7]
    px, py, pz = ((a + b) / 2 for a, b in zip(on_first, on_other, strict=True))
    forces = ((record[9], record[7]), (record[10], record[11]), (record[12], record[13]))
    fx, fy, fz = (sum(size * direction[axis] for size, direction in forces) for axis in range(3))
    return EngineContact(other, record[4], (px, py, pz), (nx, ny, nz), record[8], (fx, fy, fz))


def _negative(vector: Vector3) -> Vector3:
    x, y, z = vector
    return (-x, -y, -z)
