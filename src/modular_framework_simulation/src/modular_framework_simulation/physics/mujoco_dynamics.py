# SPDX-License-Identifier: BSD-3-Clause
"""A step of MuJoCo with the contacts and motors that PyBullet and Gazebo mean.

MuJoCo solves for accelerations that come as near as forces within their bounds allow to reference accelerations: of a
contact and of a joint with dry friction, that of coming to rest. Between its own functions, `step` puts in place:

- of two surfaces the smaller coefficients count (MuJoCo takes the larger ones);
- every reference is reached within one step, but for the share of penetrations that `PhysicsSettings` says;
- surfaces that bounce have the reference of leaving with the share of their velocity (MuJoCo has no restitution);
- a motor is dry friction against a joint that should move with the motor's velocity, so that its bound is exact, and
  it is solved together with the contacts of what it moves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_urdf.rotations import Vector3

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

SLIDING, SPINNING, ROLLING, BOUNCING, YIELDING, CORRECTION = range(6)
"""Columns of the coefficients of shapes: of friction and restitution; then, of a surface that gives way, one over its
stiffness [m/N], and the share of a penetration that is corrected in one step; 0 and 0 of one that is rigid."""

_LIMIT, _MOTOR = int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT), int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF)
_WELD = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
_SINGLE = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
"""Joints with one degree of freedom."""

_DISABLED = (
    mujoco.mjtDisableBit.mjDSBL_EULERDAMP,
    mujoco.mjtDisableBit.mjDSBL_ISLAND,
    mujoco.mjtDisableBit.mjDSBL_NATIVECCD,
)

_NOSLIP_ITERATIONS = 3
"""Passes over the friction forces without the softness of the solver: with them, what is held does not creep."""

_FREE = 1e3
"""Loss of velocity in a step [m/s] that no contact has to prevent."""

_LEAST_FRICTION = 1e-5
"""The least that MuJoCo divides by; where a coefficient is smaller, the contact has no such friction."""


@dataclass(frozen=True, slots=True)
class SavedDynamics:
    """A copy of all that moves: MuJoCo's state, and what there is of each degree of freedom."""

    physics: Array
    by_dof: tuple[Array, ...]


class MujocoDynamics:
    """A model of MuJoCo in motion.

    Args:
        model: The model.
        settings: Numbers of the physics.
        gravity: [m/s^2]

    Attributes:
        coefficients: Of shapes, see the columns above.
        motor_velocities: Of motors by degree of freedom [rad/s or m/s], to which comes what corrects the position.
        motor_targets: Positions that motors want [rad or m].
        motor_gains: Share of a position error that a motor corrects in one step; 0: it wants no position.
        motor_efforts: What the motors did in the last step [Nm or N].
        measures_loads: Whether the loads on joints are computed, see `load`.
    """

    def __init__(self, model: mujoco.MjModel, settings: PhysicsSettings, gravity: Vector3) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.settings = settings
        self.adjust(settings, gravity)
        self.coefficients = np.zeros((model.ngeom, 6))
        self._pairs = np.zeros((0, 2, 6))  # of both shapes of every contact
        self.motor_velocities, self.motor_targets, self.motor_gains, self.motor_efforts = np.zeros((4, model.nv))
        self.measures_loads = False
        self._forces, self._torques = np.zeros((2, model.nbody, 3))
        single = np.isin(model.jnt_type, _SINGLE)
        self._single_dofs, self._single_positions = model.jnt_dofadr[single], model.jnt_qposadr[single]
        self._moved = True
        self._touches: tuple[Indices, Array, Array] | None = None

    def adjust(self, settings: PhysicsSettings, gravity: Vector3) -> None:
        """Continues with other settings and gravity [m/s^2]."""
        self.settings, options = settings, self.model.opt
        options.timestep, options.gravity[:] = settings.time_step_s, gravity
        options.iterations, options.noslip_iterations = settings.solver_iterations, _NOSLIP_ITERATIONS
        options.cone, options.solver = mujoco.mjtCone.mjCONE_ELLIPTIC, mujoco.mjtSolver.mjSOL_NEWTON
        options.integrator = mujoco.mjtIntegrator.mjINT_EULER
        # Damping of joints is explicit, as `joint_resistance` computes it; islands would copy references too early.
        options.disableflags = sum(int(each) for each in _DISABLED)

    def moved(self) -> None:
        """Says that something was put elsewhere."""
        self._moved = True

    def locate(self) -> None:
        """Computes where all bodies are and how they move, if something has moved since the last time."""
        if self._moved:
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            mujoco.mj_comVel(self.model, self.data)
            self._moved = False

    def step(self) -> None:
        """Advances the physics by one time step; forces that were applied end with it.

        Raises:
            SimulationError: It came to velocities that are no numbers.
        """
        model, data = self.model, self.data
        self.locate()
        mujoco.mj_makeM(model, data)
        mujoco.mj_factorM(model, data)
        mujoco.mj_collision(model, data)
        self._pairs = self.coefficients[data.contact.geom] if data.ncon else np.zeros((0, 2, 6))
        self._set_frictions()
        mujoco.mj_makeConstraint(model, data)
        self._soften()
        mujoco.mj_island(model, data)
        mujoco.mj_projectConstraint(model, data)
        mujoco.mj_fwdVelocity(model, data)
        motors = self._set_references()
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)
        self.motor_efforts[:] = 0.0
        self.motor_efforts[data.efc_id[motors]] = data.efc_force[motors]
        self._touches = None
        if self.measures_loads:
            self._measure_loads()
        mujoco.mj_Euler(model, data)
        data.xfrc_applied[:], data.qfrc_applied[:] = 0.0, 0.0
        self._moved = True
        if not math.isfinite(float(data.qvel.sum())):
            raise SimulationError("the physics engine mujoco came to velocities that are no numbers")

    def touches(self) -> tuple[Indices, Array, Array]:
        """Returns the contacts of the last step: their two bodies, normal force [N] and distance [m]."""
        if self._touches is None:
            contact, data = self.data.contact, self.data
            if data.ncon == 0:
                self._touches = np.zeros((0, 2), dtype=np.int64), np.zeros(0), np.zeros(0)
            else:
                rows = np.array(contact.efc_address)
                forces = np.where(rows >= 0, data.efc_force[np.maximum(rows, 0)], 0.0) if data.nefc else 0.0 * rows
                self._touches = self.model.geom_bodyid[contact.geom], forces, np.array(contact.dist)
        return self._touches

    def contact(self, row: int) -> tuple[Vector3, Array, Array]:
        """Returns a contact of the last step: position [m], and normal and force [N] on the second of its bodies."""
        contact = self.data.contact[row]
        force = np.zeros(6)
        mujoco.mj_contactForce(self.model, self.data, row, force)
        axes = contact.frame.reshape(3, 3)
        x, y, z = contact.pos.tolist()
        return (x, y, z), axes[0], force[:3] @ axes

    def _set_frictions(self) -> None:
        """Gives contacts the smaller coefficients; what resists spin and roll adds up, each times the other's friction.

        The latter is the rule of Bullet.
        """
        contact, a, b = self.data.contact, self._pairs[:, 0], self._pairs[:, 1]
        if self.data.ncon == 0:
            return
        slide = np.minimum(a[:, SLIDING], b[:, SLIDING])
        spin, roll = (a[:, each] * b[:, SLIDING] + b[:, each] * a[:, SLIDING] for each in (SPINNING, ROLLING))
        kinds = np.where(roll > _LEAST_FRICTION, 6, np.where(spin > _LEAST_FRICTION, 4, 3))
        contact.dim[:] = np.where(slide > _LEAST_FRICTION, kinds, 1)
        contact.friction[:] = np.maximum(np.stack((slide, slide, spin, roll, roll), axis=1), _LEAST_FRICTION)

    def _set_references(self) -> Indices:
        """Sets the acceleration that every constraint wants; returns the rows of the motors."""
        data, settings = self.data, self.settings
        if data.nefc == 0:
            return np.zeros(0, dtype=np.int64)
        step_s, kinds = settings.time_step_s, np.asarray(data.efc_type)
        shares = np.full(data.nefc, settings.contact_erp)
        shares[kinds == _LIMIT] = settings.hardest_erp
        if data.ncon:
            self._set_shares(shares)
        # What is apart may come as near as to touch; of what is inside each other, a share comes out.
        wanted = -np.where(data.efc_pos < 0.0, shares, 1.0) / step_s * data.efc_pos
        welds = kinds == _WELD
        wanted[welds] = -settings.hardest_erp / step_s * data.efc_pos[welds]
        motors = np.flatnonzero(kinds == _MOTOR)
        positions = np.zeros(self.model.nv)
        positions[self._single_dofs] = data.qpos[self._single_positions]
        correction = self.motor_gains / step_s * (self.motor_targets - positions)
        wanted[motors] = (self.motor_velocities + correction)[data.efc_id[motors]]
        if data.ncon:
            self._let_bounce(wanted)
        data.efc_aref[:] = (wanted - data.efc_vel) / step_s
        return motors

    def _soften(self) -> None:
        """Lets contacts give way as their stiffness says: the springs of the two surfaces act one behind the other."""
        data, contact = self.data, self.data.contact
        if not self._pairs[:, :, YIELDING].any():
            return
        yielding, share = self._pairs[:, :, YIELDING].sum(axis=1), self._pairs[:, :, CORRECTION].max(axis=1)
        for each in np.flatnonzero((yielding > 0.0) & (contact.efc_address >= 0)):
            begin = contact.efc_address[each]
            rows = slice(begin, begin + contact.dim[each])
            softness = share[each] / self.settings.time_step_s**2 * yielding[each]
            data.efc_R[rows] *= max(1.0, softness / data.efc_R[begin])
            data.efc_D[rows] = 1.0 / data.efc_R[rows]

    def _set_shares(self, shares: Array) -> None:
        """Sets the share of its penetration that a contact which bounces or gives way corrects in one step."""
        present = self.data.contact.efc_address >= 0
        rows = self.data.contact.efc_address[present]
        own = self._pairs[present, :, CORRECTION].max(axis=1)
        own[own == 0.0] = self.settings.contact_erp
        shares[rows] = np.where(self._pairs[present, :, BOUNCING].min(axis=1) > 0.0, self.settings.bounce_erp, own)

    def _let_bounce(self, wanted: Array) -> None:
        """Lets bouncing contacts leave with the share of the velocity with which they met."""
        data = self.data
        shares = self._pairs[:, :, BOUNCING].min(axis=1)
        if not shares.any():
            return
        bouncing = np.flatnonzero((shares > 0.0) & (data.contact.efc_address >= 0))
        rows = data.contact.efc_address[bouncing]
        apart = rows[data.efc_pos[rows] > 0.0]
        wanted[apart] = data.efc_vel[apart] - _FREE  # the impact is to have the whole velocity
        fast = data.efc_vel[rows] < -self.settings.bounce_threshold
        fast &= data.efc_pos[rows] <= 0.0
        wanted[rows[fast]] = -shares[bouncing[fast]] * data.efc_vel[rows[fast]]

    def _measure_loads(self) -> None:
        model, data = self.model, self.data
        mujoco.mj_rnePostConstraint(model, data)
        torques, forces = data.cfrc_int[:, :3], data.cfrc_int[:, 3:]  # on each body, about the centre of its tree
        levers = data.subtree_com[model.body_rootid] - data.xpos
        axes = data.xmat.reshape(-1, 3, 3)
        self._forces = np.einsum("bji,bj->bi", axes, forces)
        self._torques = np.einsum("bji,bj->bi", axes, torques + np.cross(levers, forces))

    def load(self, body: int) -> tuple[Vector3, Vector3]:
        """Returns force [N] and torque [Nm] of a body on the one above in the last step, about and in its own frame."""
        fx, fy, fz = (-self._forces[body]).tolist()
        tx, ty, tz = (-self._torques[body]).tolist()
        return (fx, fy, fz), (tx, ty, tz)

    def by_dof(self) -> tuple[Array, ...]:
        """Returns what there is of each degree of freedom besides positions: motion, efforts, resistance, motors."""
        data, model = self.data, self.model
        motors = (self.motor_velocities, self.motor_targets, self.motor_gains, self.motor_efforts)
        return (data.qvel, data.qacc_warmstart, data.qfrc_applied, model.dof_frictionloss, model.dof_damping, *motors)

    def state(self) -> SavedDynamics:
        """Returns a copy of all that moves."""
        size = mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_INTEGRATION)
        physics = np.zeros(size)
        mujoco.mj_getState(self.model, self.data, physics, mujoco.mjtState.mjSTATE_INTEGRATION)
        return SavedDynamics(physics, tuple(values.copy() for values in self.by_dof()))

    def set_state(self, state: SavedDynamics) -> None:
        """Continues from a saved state of this model."""
        mujoco.mj_setState(self.model, self.data, state.physics, mujoco.mjtState.mjSTATE_INTEGRATION)
        for target, source in zip(self.by_dof(), state.by_dof, strict=True):
            target[:] = source
        self.data.ncon = 0
        self._touches = None
        self._moved = True
