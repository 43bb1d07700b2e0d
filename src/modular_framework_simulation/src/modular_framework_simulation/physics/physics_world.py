# SPDX-License-Identifier: BSD-3-Clause
"""Simulated world with its models; each call of `step` advances time by one physics step.

All calls must come from the thread that owns the loop.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from modular_framework_simulation.errors import DuplicateModelError, SimulationError, UnknownEntityError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.applied_forces import AppliedForces, SavedForces
from modular_framework_simulation.physics.body_forces import BodyForce, forces_of
from modular_framework_simulation.physics.body_joints import apply_settings, copy_joint_motion
from modular_framework_simulation.physics.body_links import centre_in_world, tree_with_link
from modular_framework_simulation.physics.body_urdf import STATIC_LINK, BodyUrdf, model_to_urdf
from modular_framework_simulation.physics.carried_object import CarriedObject
from modular_framework_simulation.physics.engine_choice import PYBULLET, make_engine
from modular_framework_simulation.physics.joint_resistance import set_joint_resistance
from modular_framework_simulation.physics.part_names import SCOPE
from modular_framework_simulation.physics.physics_engine import BASE_INDEX, REST_LOOK_S, Log
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.simulated_body import BodyState, SimulatedBody, Twist, twist_in_frame
from modular_framework_simulation.physics.surfaces import surface_of
from modular_framework_simulation.physics.world_rest import WorldRest
from modular_framework_urdf.rotations import Vector3

WORLD_FRAMES = ("", "world", "map", "/map")
"""Names of the world frame in requests."""
_REST_LOOK_NS = round(REST_LOOK_S * 1e9)


@dataclass(frozen=True, slots=True)
class Contact:
    """Contact between two links.

    Attributes:
        model: Name of the other model.
        force: Normal force [N].
        distance: Distance [m], negative for penetration.
    """

    model: str
    force: float
    distance: float


@dataclass(frozen=True, slots=True)
class ContactPoint:
    """Contact point between two links, in the world frame.

    Attributes:
        model: Name of the other model.
        other_link: Name of the other link; for a static model, which is one body in the engine, any of its links.
        position: Midpoint between the two surfaces [m].
        normal: Unit normal that points out of the other model.
        depth: Penetration depth [m].
        force: Force on the link, including friction [N].
    """

    model: str
    other_link: str
    position: Vector3
    normal: Vector3
    depth: float
    force: Vector3


@dataclass(frozen=True, slots=True)
class WorldState:
    """Saved state of the world.

    Attributes:
        engine: State saved by the engine.
        body_ids: Engine body ids, keyed by model name.
        welds: Welds between objects and grippers, as (model, link) pairs.
        steps: Number of physics steps.
        time_ns: Simulated time [ns].
        forces: Forces of requests.
    """

    engine: Any
    body_ids: dict[str, tuple[int, ...]]
    welds: tuple[tuple[str, str], ...]
    steps: int
    time_ns: int
    forces: SavedForces


class PhysicsWorld:
    """Models, robots and simulated time.

    Args:
        settings: Settings of the physics engine.
        convex_parts: Converter of meshes for the engine.
        gravity: Gravity vector in the world frame [m/s^2].
        gui: Whether to open a window if a display is available.
        log: Function that logs a decision.
        engine: Name of the physics engine, see `engine_choice`.

    Raises:
        SimulationError: The engine is unknown or not available.
    """

    def __init__(
        self,
        settings: PhysicsSettings,
        convex_parts: ConvexParts,
        gravity: Vector3 = (0.0, 0.0, -9.8),
        *,
        gui: bool = False,
        log: Log = print,
        engine: str = PYBULLET,
    ) -> None:
        self.settings = settings
        self.gravity = gravity
        self.engine = make_engine(engine, settings, gravity, gui, log)
        self.forces = AppliedForces(self.engine)
        self.rest = WorldRest(self.engine)
        self._initial_physics = (settings, gravity)
        self._convex_parts = convex_parts
        self._log = log
        self._noted: set[tuple[str, ...]] = set()
        self._bodies: dict[str, SimulatedBody] = {}
        self._names_by_body_id: dict[int, str] = {}
        self._initial_poses: dict[str, Pose] = {}
        self._instances: dict[str, int] = {}
        self._last_instance = 0
        self._initial: list[tuple[specs.Model, BodyUrdf]] = []
        self._forces: dict[int, tuple[BodyForce, ...]] = {}
        self.weld_grasps = False
        """Whether held objects are welded to the gripper; otherwise only friction holds them."""
        self._carried: dict[tuple[str, str], CarriedObject] = {}
        self._welds: dict[tuple[str, str], int] = {}
        self._steps = self._time_ns = self._last_computed_step = 0
        self.revision = 0
        """Revision number, which changes when a request spawns, deletes or moves a model."""

    @property
    def time_ns(self) -> int:
        """Returns the simulated time since the start or the last reset [ns]."""
        return self._time_ns

    @property
    def steps(self) -> int:
        """Returns the number of physics steps since the start or the last reset."""
        return self._steps

    @property
    def at_rest(self) -> bool:
        """Returns whether nothing moves and no force is pending, so that the next step is not computed."""
        return self.rest.holds and not self.forces.pending

    def step(self) -> None:
        """Advances the world by one time step; a world at rest is not computed."""
        if not self.at_rest:
            if self.forces.pending or self.engine.has_window:  # the user may move bodies with the mouse
                self.rest.disturb()
            self._compute_step()
            self._last_computed_step = self._steps + 1
            self.rest.after_step(self._bodies.values())
        self._steps += 1
        self._time_ns += self.settings.time_step_ns

    def _compute_step(self) -> None:
        for forces in self._forces.values():
            for force in forces:
                force.apply(self.gravity)
        self.forces.apply(self._time_ns, self._bodies)
        for carried in self._carried.values():
            carried.before_step()
        self.engine.step()
        for carried in self._carried.values():
            carried.after_step()

    def set_physics(self, settings: PhysicsSettings, gravity: Vector3) -> None:
        """Changes settings until the next `restart`.

        Args:
            settings: Settings of the physics engine.
            gravity: Gravity vector in the world frame [m/s^2].
        """
        self.engine.adjust(settings, gravity)
        self.rest.disturb()
        self.settings, self.gravity = settings, gravity
        for body in self._bodies.values():  # surface and joint parameters depend on the time step
            if body.spec is not None:
                for part in body.parts:
                    self._set_properties(part, body.spec)
                for joint, values in body.joint_settings.items():
                    apply_settings(self.engine, body, joint, values)

    def note_change(self) -> None:
        """Records that a request has changed the world."""
        self.revision += 1
        self.rest.disturb()

    def moving(self, woken: bool = False) -> set[str]:
        """Returns the names of the models that may have moved within the last REST_LOOK_S.

        Args:
            woken: Whether to include sleeping models that may have been woken within this time.
        """
        if (self._steps - self._last_computed_step) * self.settings.time_step_s > REST_LOOK_S:
            return set()
        still = self.engine.motionless() if woken else self.engine.resting()
        return {self._names_by_body_id[number] for number in self._names_by_body_id.keys() - still}

    def moved_since(self, time_ns: int, revision: int, woken: bool = False) -> set[str]:
        """Returns the names of the models that may have moved since an earlier look at the world.

        Args:
            time_ns: Simulated time of the earlier look [ns]; after more than REST_LOOK_S, all models may have moved.
            revision: Revision of the world at the earlier look.
            woken: Whether to include sleeping models that may have been woken within REST_LOOK_S.
        """
        if revision == self.revision and 0 <= self._time_ns - time_ns <= _REST_LOOK_NS:
            return self.moving(woken)
        return set(self._bodies)

    @property
    def bodies(self) -> Mapping[str, SimulatedBody]:
        """Returns a read-only view of all models by name, in order of appearance."""
        return MappingProxyType(self._bodies)

    def carry(self, robot: SimulatedBody, held: Sequence[tuple[str, str]]) -> None:
        """Sets the held models, which move with the gripper from now on.

        Args:
            robot: The robot that holds the models.
            held: Pairs of the held model and the robot link that carries it.
        """
        if tuple(self._welds if self.weld_grasps else self._carried) == tuple(held):
            return
        self.rest.disturb()
        self._release()
        for name, link in held:
            held_body, index = self.body(name), robot.link_indices[link]
            if self.weld_grasps:
                self._welds[name, link] = self.engine.weld(robot.number, index, held_body.number)
            elif index != BASE_INDEX:
                self._carried[name, link] = CarriedObject(self.engine, held_body, robot, index)

    def _release(self, name: str = "") -> None:
        """Releases a held model; without a name, all held models."""
        for key in [each for each in (*self._carried, *self._welds) if name in ("", each[0])]:
            self._carried.pop(key, None)
            if key in self._welds:
                self.engine.remove_weld(self._welds.pop(key))

    def names(self) -> list[str]:
        """Returns the names of all models, in order of appearance."""
        return list(self._bodies)

    def body(self, name: str) -> SimulatedBody:
        """Returns a model.

        Raises:
            UnknownEntityError: The model does not exist.
        """
        body = self._bodies.get(name)
        if body is None:
            raise UnknownEntityError("model", name, self.names())
        return body

    def prepare(self, model: specs.Model) -> BodyUrdf:
        """Converts a model for the engine, which may take seconds for a large mesh; may be called from any thread.

        Raises:
            DescriptionError: A mesh is unsupported or invalid.
        """
        concave = self.engine.takes_concave_meshes
        return model_to_urdf(model, self._convex_parts, self.engine.has_window, concave)

    def spawn(self, model: specs.Model, prepared: BodyUrdf | None = None, keep: bool = False) -> SimulatedBody:
        """Adds a model at its pose.

        Args:
            model: Description of the model.
            prepared: Result of `prepare` for the model; None to convert the model now.
            keep: Whether the model belongs to the initial world, which `restart` restores.

        Raises:
            DuplicateModelError: The name is already in use.
            DescriptionError: The engine cannot represent the model.
        """
        if model.name in self._bodies:
            raise DuplicateModelError(model.name)
        urdf = prepared if prepared is not None else self.prepare(model)
        if model.notes and model.notes not in self._noted:
            self._noted.add(model.notes)
            self._log(f"model '{model.name}': {'; '.join(model.notes)}")
        body = self._load(model, urdf)
        self.add(body, model.pose)
        if keep:
            self._initial.append((model, urdf))
        return body

    def _load(self, model: specs.Model, urdf: BodyUrdf) -> SimulatedBody:
        parts = []
        for tree in (urdf, *urdf.further):
            number = self.engine.load_urdf(tree.text, model.name, tree.fixed)
            parts.append(SimulatedBody(self.engine, number, model.name, tree=tree, static=model.static, spec=model))
            parts[-1].release_ball_joints()
            self._set_properties(parts[-1], model)
        body = parts[0]
        body.further = tuple(parts[1:])
        return body

    def replace(self, model: specs.Model, prepared: BodyUrdf) -> None:
        """Replaces the description of a model; its motion continues, with joints within the new limits.

        Args:
            model: New description, with the name, links and joints of the existing model.
            prepared: Result of `prepare` for the new description.

        Raises:
            UnknownEntityError: The model does not exist.
            DescriptionError: The engine cannot represent the model; nothing has changed.
        """
        old = self.body(model.name)
        body = self._load(model, prepared)
        for old_part, part in zip(old.parts, body.parts, strict=True):  # moving the first tree also moves the others
            part.set_state(old_part.state())
            copy_joint_motion(self.engine, old_part, part)
        self._remove(old)
        self._bodies[model.name] = body
        self._names_by_body_id.update({part.number: model.name for part in body.parts})
        self.note_change()

    def _remove(self, body: SimulatedBody) -> None:
        self._release(body.name)
        for part in body.parts:
            self.engine.remove_body(part.number)
            del self._names_by_body_id[part.number]
            self._forces.pop(part.number, None)

    def add(self, body: SimulatedBody, pose_in_world: Pose) -> None:
        """Adds a body that is already in the engine, at a pose in the world frame."""
        if body.name in self._bodies:
            raise DuplicateModelError(body.name)
        body.place_at_rest(pose_in_world)
        self._bodies[body.name] = body
        self._last_instance += 1
        self._instances[body.name] = self._last_instance
        self._names_by_body_id.update({part.number: body.name for part in body.parts})
        self._initial_poses[body.name] = pose_in_world
        self.note_change()

    def delete(self, name: str) -> None:
        """Removes a model.

        Raises:
            UnknownEntityError: The model does not exist.
        """
        body = self.body(name)
        self._remove(body)
        del self._bodies[name], self._initial_poses[name], self._instances[name]
        self.forces.forget_model(name)
        self.note_change()

    def entity_state(self, entity: str) -> BodyState:
        """Returns pose and twist of a model or a link ("model::link") in the world frame.

        Raises:
            UnknownEntityError: The model or link does not exist.
        """
        if entity in WORLD_FRAMES:
            return BodyState(Pose(), Twist())
        if entity in self._bodies:
            return self._bodies[entity].state()
        model, separator, link = entity.partition(SCOPE)
        while separator:  # names of models and of links of inner models may contain the separator
            if model in self._bodies:
                return self._bodies[model].link_state(link)
            next_part, separator, link = link.partition(SCOPE)
            model += SCOPE + next_part
        raise UnknownEntityError("model", entity, self.names())

    def state_relative_to(self, entity: str, reference: str) -> BodyState:
        """Returns the state of a model or link relative to another model or link.

        Args:
            entity: Model, or "model::link".
            reference: Model, "model::link", or the world.

        Raises:
            UnknownEntityError: The entity or the reference does not exist.
        """
        state, frame = self.entity_state(entity), self.entity_state(reference)
        if reference in WORLD_FRAMES:
            return state
        linear = tuple(a - b for a, b in zip(state.twist.linear, frame.twist.linear, strict=True))
        angular = tuple(a - b for a, b in zip(state.twist.angular, frame.twist.angular, strict=True))
        relative = Twist((linear[0], linear[1], linear[2]), (angular[0], angular[1], angular[2]))
        return BodyState(frame.pose.inverse() @ state.pose, twist_in_frame(relative, frame.pose))

    def set_state(self, name: str, state: BodyState, reference: str = "") -> None:
        """Sets pose and twist of a model.

        Args:
            name: Name of the model.
            state: State relative to the reference.
            reference: Model, "model::link", or the world.

        Raises:
            UnknownEntityError: The model or the reference does not exist.
        """
        body = self.body(name)
        body.set_state(self.state_in_world(state, reference))
        self.note_change()

    def state_in_world(self, state: BodyState, reference: str) -> BodyState:
        """Converts a state relative to a reference into a state in the world frame.

        As in gazebo_ros, the twist is only rotated into the world frame; the motion of the reference is not added.

        Raises:
            UnknownEntityError: The reference does not exist.
        """
        frame = self.entity_state(reference).pose
        return BodyState(frame @ state.pose, twist_in_frame(state.twist, frame.inverse()))

    def pose_in_world(self, pose: Pose, reference: str) -> Pose:
        """Converts a pose in the frame of a reference into a pose in the world frame."""
        return self.entity_state(reference).pose @ pose

    def contacts(self, body: SimulatedBody, link_index: int) -> list[Contact]:
        """Returns the contacts of a link, except contacts with links of its own body."""
        return [
            Contact(self._names_by_body_id[touch.other], touch.force, touch.distance)
            for touch in self.engine.link_contacts(body.number, link_index)
            if touch.other in self._names_by_body_id
        ]

    def touched_models(self, body: SimulatedBody) -> set[str]:
        """Returns the names of the other models that any link of a model pressed on in the last step."""
        ids = {other for part in body.parts for other in self.engine.touched_bodies(part.number)}
        return {self._names_by_body_id[each] for each in ids if each in self._names_by_body_id} - {body.name}

    def contact_points(self, model: str, link: str) -> list[ContactPoint]:
        """Returns the contact points of a link in the last physics step.

        Args:
            model: Name of the model.
            link: Name of the link; for a static model, which is one body in the engine, any of its links.

        Raises:
            UnknownEntityError: The model or link does not exist.
        """
        body = self.body(model)
        tree = body if body.static and body.spec is not None else tree_with_link(body, link)
        found = []
        for point in self.engine.contact_points(tree.number, tree.link_indices.get(link, BASE_INDEX)):
            name = self._names_by_body_id.get(point.number)
            if name is not None:
                other = self._bodies[name].link_name_of(point.number, point.index)
                found.append(ContactPoint(name, other, point.position, point.normal, -point.distance, point.force))
        return found

    def centre_of_mass(self, model: str, link: str) -> Vector3:
        """Returns the centre of mass of a link in the world frame [m]; for a static link, the origin of the link.

        Raises:
            UnknownEntityError: The model or link does not exist.
        """
        body = self.body(model)
        if body.static and body.spec is not None:
            return body.link_state(link).pose.position
        return centre_in_world(self.engine, body, link).position

    def reset_poses(self) -> None:
        """Resets all models to their initial poses at rest, with joints at 0, and removes the forces of requests."""
        self.forces.clear()
        self._release()
        for name, body in self._bodies.items():
            if body.spec is not None:
                body.reset_joints({})
                body.place_at_rest(self._initial_poses[name])
        self.note_change()

    def instance(self, name: str) -> int:
        """Returns the unique number of a model, which no other model has or had, even before a restart.

        Raises:
            UnknownEntityError: The model does not exist.
        """
        return self._instances[self.body(name).name]

    def restart(self) -> None:
        """Restarts the engine with the initial models and time 0; robots must be loaded again."""
        self._release()
        self.settings, self.gravity = self._initial_physics
        self.engine.settings = self.settings
        self.engine.restart(self.gravity)
        self.forces.clear()
        self._bodies.clear()
        self._names_by_body_id.clear()
        self._forces.clear()
        self._initial_poses.clear()
        self._instances.clear()
        for model, prepared in self._initial:
            self.spawn(model, prepared)
        self.reset_time()
        self.note_change()

    def save_state(self) -> WorldState:
        """Returns the motion of all bodies, the time and the forces of requests, for `restore_state`.

        The state does not include controllers, their commands, and settings changed by requests.
        """
        self.rest.disturb()  # as in `restore_state`, so that both runs continue identically
        forces = self.forces.save()
        return WorldState(
            self.engine.save_state(), self._body_ids(), tuple(self._welds), self._steps, self._time_ns, forces
        )

    def restore_state(self, state: WorldState) -> None:
        """Continues from a saved state, with bitwise identical results.

        Raises:
            SimulationError: Models were spawned, deleted or replaced since.
        """
        if state.body_ids != self._body_ids():
            raise SimulationError("the models have changed since the state was saved, so it cannot be restored")
        if state.welds != tuple(self._welds):
            raise SimulationError("the held objects have changed since the state was saved, so it cannot be restored")
        self.engine.restore_state(state.engine)
        self._steps = self._last_computed_step = state.steps
        self._time_ns = state.time_ns
        self.forces.restore(state.forces)
        self.note_change()

    def forget_state(self, state: WorldState) -> None:
        """Deletes a saved state."""
        self.engine.forget_state(state.engine)

    def _body_ids(self) -> dict[str, tuple[int, ...]]:
        return {name: tuple(part.number for part in body.parts) for name, body in self._bodies.items()}

    def reset_time(self) -> None:
        """Resets simulated time to 0."""
        self._steps = self._time_ns = self._last_computed_step = 0

    def close(self) -> None:
        """Closes the physics engine; may be called twice."""
        self.engine.close()

    def _set_properties(self, body: SimulatedBody, model: specs.Model) -> None:
        """Sets properties of a tree that its URDF does not contain: surfaces, and resistance of links and joints."""
        engine = self.engine
        for link in model.links:
            index = body.link_indices.get(STATIC_LINK if model.static else link.name)
            if index is not None and link.collisions:
                engine.set_surface(body.number, index, surface_of(link.collisions, engine.settings))
                engine.remove_margin(body.number, index)
        engine.remove_velocity_damping(body.number)
        set_joint_resistance(engine, body, {joint.name: joint.dynamics for joint in model.joints})
        if forces := forces_of(engine, body, model):
            self._forces[body.number] = forces
