# SPDX-License-Identifier: BSD-3-Clause
"""Time step of MuJoCo with contact and motor models as in PyBullet and Gazebo.

MuJoCo solves for accelerations as close to reference accelerations as the bounds of the forces allow. For a contact or
a joint with dry friction, the reference acceleration stops the motion. Between MuJoCo's own functions, `step` changes
the following:

- A contact uses the smaller coefficients of its two surfaces (MuJoCo uses the larger coefficients).
- Every reference is reached within one step, except the fraction of penetrations given by `PhysicsSettings`.
- Bouncing surfaces have a reference velocity in proportion to the impact velocity (MuJoCo has no restitution).
- A motor is modelled as dry friction relative to its target velocity, so that its effort limit is exact and the solver
  handles motors and contacts together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_urdf.rotations import Vector3

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

SLIDING, SPINNING, ROLLING, RESTITUTION, COMPLIANCE, CORRECTION = range(6)
"""Columns of the coefficients of shapes: friction and restitution; for a compliant surface also the compliance [m/N]
and the fraction of a penetration that is corrected in one step, which are 0 for a rigid surface."""

_LIMIT, _MOTOR = int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT), int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF)
_WELD = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
_ONE_DOF_TYPES = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
"""Types of joints with one degree of freedom."""

_DISABLED = (
    mujoco.mjtDisableBit.mjDSBL_EULERDAMP,
    mujoco.mjtDisableBit.mjDSBL_ISLAND,
    mujoco.mjtDisableBit.mjDSBL_NATIVECCD,
)

_NOSLIP_ITERATIONS = 3
"""Number of solver passes without constraint softness; these passes prevent creep of held objects."""

_OPEN_CONTACT_VELOCITY_DROP = 1e3
"""Velocity drop that an open contact allows in a step [m/s]; so large that no force acts before the impact."""

_MIN_FRICTION = 1e-5
"""Minimum friction coefficient, because MuJoCo divides by coefficients; a smaller coefficient disables this type of
friction."""


@dataclass(frozen=True, slots=True)
class SavedDynamics:
    """Copy of MuJoCo's state and of all values per degree of freedom."""

    physics: Array
    values_per_dof: tuple[Array, ...]


class Contacts(NamedTuple):
    """Contacts of a step.

    Attributes:
        bodies: Ids of both bodies, shape (n, 2).
        forces: Normal forces, shape (n,) [N].
        distances: Distances, shape (n,) [m].
    """

    bodies: Indices
    forces: Array
    distances: Array


class ContactForce(NamedTuple):
    """Position of a contact [m], and normal and force [N] on its second body."""

    position: Vector3
    normal: Array
    force: Array


class MujocoDynamics:
    """State of a MuJoCo model in motion.

    Args:
        model: Compiled model.
        settings: Settings of the physics.
        gravity: Gravity vector in the world frame [m/s^2].

    Attributes:
        coefficients: Coefficients of shapes, shape (n, 6), with the columns above.
        motor_velocities: Motor velocities without position correction, by degree of freedom [rad/s or m/s].
        motor_targets: Target positions of motors, by degree of freedom [rad or m].
        motor_gains: Fraction of a position error that a motor corrects in one step, by degree of freedom; 0 for a
            motor without target position.
        motor_efforts: Efforts of the motors in the last step, by degree of freedom [Nm or N].
        measures_loads: Whether the loads on joints are computed, see `load`.
    """

    def __init__(self, model: mujoco.MjModel, settings: PhysicsSettings, gravity: Vector3) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.settings = settings
        self.adjust(settings, gravity)
        self.coefficients = np.zeros((model.ngeom, 6))
        self._pairs = np.zeros((0, 2, 6))  # coefficients of both shapes, by contact
        self.motor_velocities, self.motor_targets, self.motor_gains, self.motor_efforts = np.zeros((4, model.nv))
        self.measures_loads = False
        self._forces, self._torques = np.zeros((2, model.nbody, 3))
        single = np.isin(model.jnt_type, _ONE_DOF_TYPES)
        self._single_dofs, self._single_positions = model.jnt_dofadr[single], model.jnt_qposadr[single]
        self._outdated = True
        self._contacts: Contacts | None = None

    def adjust(self, settings: PhysicsSettings, gravity: Vector3) -> None:
        """Changes settings and gravity [m/s^2]."""
        self.settings, options = settings, self.model.opt
        options.timestep, options.gravity[:] = settings.time_step_s, gravity
        options.iterations, options.noslip_iterations = settings.solver_iterations, _NOSLIP_ITERATIONS
        options.cone, options.solver = mujoco.mjtCone.mjCONE_ELLIPTIC, mujoco.mjtSolver.mjSOL_NEWTON
        options.integrator = mujoco.mjtIntegrator.mjINT_EULER
        # Joint damping is explicit, computed by `joint_resistance`; with islands, MuJoCo would copy the references
        # before they are set.
        options.disableflags = sum(int(each) for each in _DISABLED)

    def mark_moved(self) -> None:
        """Records that a position was changed from outside."""
        self._outdated = True

    def update_kinematics(self) -> None:
        """Computes poses and velocities of all bodies, if a body has moved since the last call."""
        if self._outdated:
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            mujoco.mj_comVel(self.model, self.data)
            self._outdated = False

    def step(self) -> None:
        """Advances the physics by one time step; applied forces end with the step.

        Raises:
            SimulationError: The velocities are no longer finite.
        """
        model, data = self.model, self.data
        self.update_kinematics()
        mujoco.mj_makeM(model, data)
        mujoco.mj_factorM(model, data)
        mujoco.mj_collision(model, data)
        self._pairs = self.coefficients[data.contact.geom] if data.ncon else np.zeros((0, 2, 6))
        self._set_frictions()
        mujoco.mj_makeConstraint(model, data)
        self._set_softness()
        mujoco.mj_island(model, data)
        mujoco.mj_projectConstraint(model, data)
        mujoco.mj_fwdVelocity(model, data)
        motors = self._set_references()
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)
        self.motor_efforts[:] = 0.0
        self.motor_efforts[data.efc_id[motors]] = data.efc_force[motors]
        self._contacts = None
        if self.measures_loads:
            self._measure_loads()
        mujoco.mj_Euler(model, data)
        data.xfrc_applied[:], data.qfrc_applied[:] = 0.0, 0.0
        self._outdated = True
        if not math.isfinite(float(data.qvel.sum())):
            raise SimulationError("the velocities of the physics engine mujoco are no longer finite")

    def contacts(self) -> Contacts:
        """Returns the contacts of the last step."""
        if self._contacts is None:
            contact, data = self.data.contact, self.data
            if data.ncon == 0:
                self._contacts = Contacts(np.zeros((0, 2), dtype=np.int64), np.zeros(0), np.zeros(0))
            else:
                rows = np.array(contact.efc_address)
                forces = np.where(rows >= 0, data.efc_force[np.maximum(rows, 0)], 0.0) if data.nefc else 0.0 * rows
                self._contacts = Contacts(self.model.geom_bodyid[contact.geom], forces, np.array(contact.dist))
        return self._contacts

    def contact(self, row: int) -> ContactForce:
        """Returns a contact of the last step."""
        contact = self.data.contact[row]
        force = np.zeros(6)
        mujoco.mj_contactForce(self.model, self.data, row, force)
        axes = contact.frame.reshape(3, 3)
        x, y, z = contact.pos.tolist()
        return ContactForce((x, y, z), axes[0], force[:3] @ axes)

    def _set_frictions(self) -> None:
        """Sets the friction of contacts: the smaller sliding coefficients, and combined spinning and rolling terms.

        As in Bullet, the resistances of both surfaces add up, each multiplied by the other's sliding coefficient.
        """
        contact, a, b = self.data.contact, self._pairs[:, 0], self._pairs[:, 1]
        if self.data.ncon == 0:
            return
        slide = np.minimum(a[:, SLIDING], b[:, SLIDING])
        spin, roll = (a[:, each] * b[:, SLIDING] + b[:, each] * a[:, SLIDING] for each in (SPINNING, ROLLING))
        kinds = np.where(roll > _MIN_FRICTION, 6, np.where(spin > _MIN_FRICTION, 4, 3))
        contact.dim[:] = np.where(slide > _MIN_FRICTION, kinds, 1)
        contact.friction[:] = np.maximum(np.stack((slide, slide, spin, roll, roll), axis=1), _MIN_FRICTION)

    def _set_references(self) -> Indices:
        """Sets the reference acceleration of every constraint; returns the rows of the motors."""
        data, settings = self.data, self.settings
        if data.nefc == 0:
            return np.zeros(0, dtype=np.int64)
        step_s, kinds = settings.time_step_s, np.asarray(data.efc_type)
        fractions = np.full(data.nefc, settings.contact_erp)
        fractions[kinds == _LIMIT] = settings.hardest_erp
        if data.ncon:
            self._set_correction_fractions(fractions)
        # A gap may close exactly within the step; a penetration is corrected by a fraction.
        references = -np.where(data.efc_pos < 0.0, fractions, 1.0) / step_s * data.efc_pos
        welds = kinds == _WELD
        references[welds] = -settings.hardest_erp / step_s * data.efc_pos[welds]
        motors = np.flatnonzero(kinds == _MOTOR)
        positions = np.zeros(self.model.nv)
        positions[self._single_dofs] = data.qpos[self._single_positions]
        correction = self.motor_gains / step_s * (self.motor_targets - positions)
        references[motors] = (self.motor_velocities + correction)[data.efc_id[motors]]
        if data.ncon:
            self._set_bounce_references(references)
        data.efc_aref[:] = (references - data.efc_vel) / step_s
        return motors

    def _set_softness(self) -> None:
        """Sets the softness of contacts, with the springs of the two surfaces in series."""
        data, contact = self.data, self.data.contact
        if not self._pairs[:, :, COMPLIANCE].any():
            return
        compliance, fraction = self._pairs[:, :, COMPLIANCE].sum(axis=1), self._pairs[:, :, CORRECTION].max(axis=1)
        for each in np.flatnonzero((compliance > 0.0) & (contact.efc_address >= 0)):
            begin = contact.efc_address[each]
            rows = slice(begin, begin + contact.dim[each])
            softness = fraction[each] / self.settings.time_step_s**2 * compliance[each]
            data.efc_R[rows] *= max(1.0, softness / data.efc_R[begin])
            data.efc_D[rows] = 1.0 / data.efc_R[rows]

    def _set_correction_fractions(self, fractions: Array) -> None:
        """Sets the fraction of penetration that bouncing and compliant contacts correct in one step."""
        active = self.data.contact.efc_address >= 0
        rows = self.data.contact.efc_address[active]
        correction = self._pairs[active, :, CORRECTION].max(axis=1)
        correction[correction == 0.0] = self.settings.contact_erp
        fractions[rows] = np.where(
            self._pairs[active, :, RESTITUTION].min(axis=1) > 0.0, self.settings.bounce_erp, correction
        )

    def _set_bounce_references(self, references: Array) -> None:
        """Sets the separation velocity of bouncing contacts in proportion to their impact velocity."""
        data = self.data
        fractions = self._pairs[:, :, RESTITUTION].min(axis=1)
        if not fractions.any():
            return
        bouncing = np.flatnonzero((fractions > 0.0) & (data.contact.efc_address >= 0))
        rows = data.contact.efc_address[bouncing]
        apart = rows[data.efc_pos[rows] > 0.0]
        references[apart] = data.efc_vel[apart] - _OPEN_CONTACT_VELOCITY_DROP  # no braking before the impact
        fast = data.efc_vel[rows] < -self.settings.bounce_threshold
        fast &= data.efc_pos[rows] <= 0.0
        references[rows[fast]] = -fractions[bouncing[fast]] * data.efc_vel[rows[fast]]

    def _measure_loads(self) -> None:
        model, data = self.model, self.data
        mujoco.mj_rnePostConstraint(model, data)
        torques, forces = data.cfrc_int[:, :3], data.cfrc_int[:, 3:]  # about the centre of mass of each tree
        levers = data.subtree_com[model.body_rootid] - data.xpos
        axes = data.xmat.reshape(-1, 3, 3)
        self._forces = np.einsum("bji,bj->bi", axes, forces)
        self._torques = np.einsum("bji,bj->bi", axes, torques + np.cross(levers, forces))

    def load(self, body: int) -> tuple[Vector3, Vector3]:
        """Returns the force [N] and torque [Nm] of a body on its parent in the last step, in the body frame."""
        fx, fy, fz = (-self._forces[body]).tolist()
        tx, ty, tz = (-self._torques[body]).tolist()
        return (fx, fy, fz), (tx, ty, tz)

    def values_per_dof(self) -> tuple[Array, ...]:
        """Returns all values per degree of freedom except positions: motion, efforts, resistance and motors."""
        data, model = self.data, self.model
        motors = (self.motor_velocities, self.motor_targets, self.motor_gains, self.motor_efforts)
        return (data.qvel, data.qacc_warmstart, data.qfrc_applied, model.dof_frictionloss, model.dof_damping, *motors)

    def state(self) -> SavedDynamics:
        """Returns a copy of the state."""
        size = mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_INTEGRATION)
        physics = np.zeros(size)
        mujoco.mj_getState(self.model, self.data, physics, mujoco.mjtState.mjSTATE_INTEGRATION)
        return SavedDynamics(physics, tuple(values.copy() for values in self.values_per_dof()))

    def set_state(self, state: SavedDynamics) -> None:
        """Restores a saved state of this model."""
        mujoco.mj_setState(self.model, self.data, state.physics, mujoco.mjtState.mjSTATE_INTEGRATION)
        for target, source in zip(self.values_per_dof(), state.values_per_dof, strict=True):
            target[:] = source
        self.data.ncon = 0
        self._contacts = None
        self._outdated = True
