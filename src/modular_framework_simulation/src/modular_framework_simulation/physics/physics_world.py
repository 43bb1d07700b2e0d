# SPDX-License-Identifier: BSD-3-Clause
"""The simulated world: models in it, and time that advances one physics step at a call.

All calls come from one thread, the one that owns the loop.
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
"""Names that stand for the frame of the world in requests."""


@dataclass(frozen=True, slots=True)
class Contact:
    """A touch between two links.

    Attributes:
        model: The other model.
        force: Normal force [N].
        distance: Negative when they penetrate [m].
    """

    model: str
    force: float
    distance: float


@dataclass(frozen=True, slots=True)
class ContactPoint:
    """A point where a link touches another one, in the world.

    Attributes:
        model: The other model.
        other_link: Its link; of a static model, which is one body for the engine, any of its links.
        position: Half way between the two surfaces [m].
        normal: Unit vector out of the other model.
        depth: How deep they are in each other [m].
        force: On the link, friction too [N].
    """

    model: str
    other_link: str
    position: Vector3
    normal: Vector3
    depth: float
    force: Vector3


@dataclass(frozen=True, slots=True)
class WorldState:
    """A saved state of the world.

    Attributes:
        engine: What the engine saved.
        numbers: Its numbers of the bodies, by model.
        welded: What is fastened to hands: model and link.
        steps: Physics steps until then.
        time_ns: Simulated time [ns].
        forces: Of requests.
    """

    engine: Any
    numbers: dict[str, tuple[int, ...]]
    welded: tuple[tuple[str, str], ...]
    steps: int
    time_ns: int
    forces: SavedForces


class PhysicsWorld:
    """Models, a robot or two, and simulated time.

    Args:
        settings: Numbers of the physics engine.
        convex_parts: Cuts meshes for the engine.
        gravity: [m/s^2]
        gui: Whether to open a window, if there is a display.
        log: Takes lines of text about what was decided.
        engine: Name of the physics engine, see `engine_choice`.
        weld_grasps: Whether objects that a gripper holds are fastened to it; else friction alone holds them.

    Raises:
        SimulationError: There is no such engine, or it cannot be used.
    """

    def __init__(
        self,
        settings: PhysicsSettings,
        convex_parts: ConvexParts,
        gravity: Vector3 = (0.0, 0.0, -9.8),
        gui: bool = False,
        log: Log = print,
        engine: str = PYBULLET,
        weld_grasps: bool = False,
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
        self._names_by_number: dict[int, str] = {}
        self._initial_poses: dict[str, Pose] = {}
        self._instances: dict[str, int] = {}
        self._last_instance = 0
        self._initial: list[tuple[specs.Model, BodyUrdf]] = []
        self._forces: dict[int, tuple[BodyForce, ...]] = {}
        self.weld_grasps = weld_grasps
        self._carried: dict[tuple[str, str], CarriedObject] = {}
        self._welds: dict[tuple[str, str], int] = {}
        self._steps = self._time_ns = self._computed_until = 0
        self.revision = 0
        """Changes whenever a model is spawned, deleted or moved by a request."""

    @property
    def time_ns(self) -> int:
        """Simulated time [ns] since the start or the last reset."""
        return self._time_ns

    @property
    def steps(self) -> int:
        """Physics steps since the start or the last reset."""
        return self._steps

    @property
    def at_rest(self) -> bool:
        """Whether nothing moves and nothing is to move it: the coming step is not computed then."""
        return self.rest.holds and not self.forces.pending

    def step(self) -> None:
        """Advances the world by one time step; a world in which everything is at rest is not computed."""
        if not self.at_rest:
            if self.forces.pending or self.engine.has_window:  # in a window, the mouse moves bodies
                self.rest.disturb()
            self._compute_step()
            self._computed_until = self._steps + 1
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
        """Continues with other settings, until `restart`.

        Args:
            settings: Numbers of the physics engine.
            gravity: [m/s^2]
        """
        self.engine.adjust(settings, gravity)
        self.rest.disturb()
        self.settings, self.gravity = settings, gravity
        for body in self._bodies.values():  # how surfaces and joints resist depends on the step
            if body.spec is not None:
                for part in body.parts:
                    self._set_properties(part, body.spec)
                for joint, values in body.joint_settings.items():
                    apply_settings(self.engine, body, joint, values)

    def note_change(self) -> None:
        """Says that a request has changed something in the world."""
        self.revision += 1
        self.rest.disturb()

    def moving(self) -> set[str]:
        """Returns the names of the models that are not known to have been at rest for REST_LOOK_S."""
        if (self._steps - self._computed_until) * self.settings.time_step_s > REST_LOOK_S:
            return set()
        return {self._names_by_number[number] for number in self._names_by_number.keys() - self.engine.resting()}

    @property
    def bodies(self) -> Mapping[str, SimulatedBody]:
        """All models by name, in order of appearance; a view."""
        return MappingProxyType(self._bodies)

    def carry(self, robot: SimulatedBody, held: Sequence[tuple[str, str]]) -> None:
        """Sets which models move with a hand from now on: those that are held.

        Args:
            robot: The robot that holds them.
            held: Model and the robot's link that carries it, of each.
        """
        if tuple(self._welds if self.weld_grasps else self._carried) == tuple(held):
            return
        self.rest.disturb()
        self._let_go()
        for name, link in held:
            thing, index = self.body(name), robot.link_indices[link]
            if self.weld_grasps:
                self._welds[name, link] = self.engine.weld(robot.number, index, thing.number)
            elif index != BASE_INDEX:
                self._carried[name, link] = CarriedObject(self.engine, thing, robot, index)

    def _let_go(self, name: str = "") -> None:
        """Lets hands carry a model no more; without a name, all of them."""
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
            UnknownEntityError: There is no such model.
        """
        body = self._bodies.get(name)
        if body is None:
            raise UnknownEntityError("model", name, self.names())
        return body

    def prepare(self, model: specs.Model) -> BodyUrdf:
        """Translates a model for the engine, which may take seconds for a large mesh; any thread may do it.

        Raises:
            DescriptionError: A mesh cannot be used.
        """
        concave = self.engine.takes_concave_meshes
        return model_to_urdf(model, self._convex_parts, self.engine.has_window, concave)

    def spawn(self, model: specs.Model, prepared: BodyUrdf | None = None, keep: bool = False) -> SimulatedBody:
        """Adds a model at its pose.

        Args:
            model: What to add.
            prepared: What `prepare` made of it, if that was called before.
            keep: Whether it belongs to the world as `restart` makes it.

        Raises:
            DuplicateModelError: Its name is taken.
            DescriptionError: The engine cannot represent it.
        """
        if model.name in self._bodies:
            raise DuplicateModelError(model.name)
        written = prepared if prepared is not None else self.prepare(model)
        if model.notes and model.notes not in self._noted:
            self._noted.add(model.notes)
            self._log(f"model '{model.name}': {'; '.join(model.notes)}")
        body = self._load(model, written)
        self.add(body, model.pose)
        if keep:
            self._initial.append((model, written))
        return body

    def _load(self, model: specs.Model, written: BodyUrdf) -> SimulatedBody:
        parts = []
        for tree in (written, *written.further):
            number = self.engine.load_urdf(tree.text, model.name, tree.fixed)
            parts.append(SimulatedBody(self.engine, number, model.name, tree, model.static, model))
            parts[-1].release_ball_joints()
            self._set_properties(parts[-1], model)
        body = parts[0]
        body.further = tuple(parts[1:])
        return body

    def replace(self, model: specs.Model, prepared: BodyUrdf) -> None:
        """Gives a model another description; it goes on moving as it does, joints within their limits.

        Args:
            model: Has the name of the model that it takes the place of, and its links and joints.
            prepared: What `prepare` made of it.

        Raises:
            UnknownEntityError: There is no such model.
            DescriptionError: The engine cannot represent it; nothing has changed then.
        """
        old = self.body(model.name)
        body = self._load(model, prepared)
        for before, part in zip(old.parts, body.parts, strict=True):  # the first one takes the others along
            part.set_state(before.state())
            copy_joint_motion(self.engine, before, part)
        self._remove(old)
        self._bodies[model.name] = body
        self._names_by_number.update({part.number: model.name for part in body.parts})
        self.note_change()

    def _remove(self, body: SimulatedBody) -> None:
        self._let_go(body.name)
        for part in body.parts:
            self.engine.remove_body(part.number)
            del self._names_by_number[part.number]
            self._forces.pop(part.number, None)

    def add(self, body: SimulatedBody, pose_in_world: Pose) -> None:
        """Adds a body that is already in the engine, at a pose in the world frame."""
        if body.name in self._bodies:
            raise DuplicateModelError(body.name)
        body.put_together(pose_in_world)
        self._bodies[body.name] = body
        self._last_instance += 1
        self._instances[body.name] = self._last_instance
        self._names_by_number.update({part.number: body.name for part in body.parts})
        self._initial_poses[body.name] = pose_in_world
        self.note_change()

    def delete(self, name: str) -> None:
        """Removes a model.

        Raises:
            UnknownEntityError: There is no such model.
        """
        body = self.body(name)
        self._remove(body)
        del self._bodies[name], self._initial_poses[name], self._instances[name]
        self.forces.forget_model(name)
        self.note_change()

    def entity_state(self, entity: str) -> BodyState:
        """Returns where a model or a link ("model::link") is in the world and how it moves.

        Raises:
            UnknownEntityError: There is no such model or link.
        """
        if entity in WORLD_FRAMES:
            return BodyState(Pose(), Twist())
        if entity in self._bodies:
            return self._bodies[entity].state()
        model, separator, link = entity.partition(SCOPE)
        while separator:  # a link of an inner model has the separator in its name, and so may the name of a model
            if model in self._bodies:
                return self._bodies[model].link_state(link)
            following, separator, link = link.partition(SCOPE)
            model += SCOPE + following
        raise UnknownEntityError("model", entity, self.names())

    def state_relative_to(self, entity: str, reference: str) -> BodyState:
        """Returns the state of a model or link as seen from another one.

        Args:
            entity: Model, or "model::link".
            reference: Model, "model::link", or the world.

        Raises:
            UnknownEntityError: One of them does not exist.
        """
        state, frame = self.entity_state(entity), self.entity_state(reference)
        if reference in WORLD_FRAMES:
            return state
        linear = tuple(a - b for a, b in zip(state.twist.linear, frame.twist.linear, strict=True))
        angular = tuple(a - b for a, b in zip(state.twist.angular, frame.twist.angular, strict=True))
        relative = Twist((linear[0], linear[1], linear[2]), (angular[0], angular[1], angular[2]))
        return BodyState(frame.pose.inverse() @ state.pose, twist_in_frame(relative, frame.pose))

    def set_state(self, name: str, state: BodyState, reference: str = "") -> None:
        """Puts a model somewhere.

        Args:
            name: The model.
            state: Seen from the reference.
            reference: Model, "model::link", or the world.

        Raises:
            UnknownEntityError: The model or the reference does not exist.
        """
        body = self.body(name)
        body.set_state(self.state_in_world(state, reference))
        self.note_change()

    def state_in_world(self, state: BodyState, reference: str) -> BodyState:
        """Returns a state given in a reference as one in the world.

        As in gazebo_ros, the twist is turned into the axes of the world; the motion of the reference is not added.

        Raises:
            UnknownEntityError: The reference does not exist.
        """
        frame = self.entity_state(reference).pose
        return BodyState(frame @ state.pose, twist_in_frame(state.twist, frame.inverse()))

    def pose_in_world(self, pose: Pose, reference: str) -> Pose:
        """Returns a pose given in a reference as a pose in the world."""
        return self.entity_state(reference).pose @ pose

    def contacts(self, body: SimulatedBody, link_index: int) -> list[Contact]:
        """Returns what touches a link, other links of its own body left out."""
        return [
            Contact(self._names_by_number[touch.other], touch.force, touch.distance)
            for touch in self.engine.touches(body.number, link_index)
            if touch.other in self._names_by_number
        ]

    def contact_points(self, model: str, link: str) -> list[ContactPoint]:
        """Returns where a link touches others, as the last physics step had it.

        Args:
            model: The model.
            link: Its link; for a static model, which is one body for the engine, any of its links.

        Raises:
            UnknownEntityError: There is no such model or link.
        """
        body = self.body(model)
        tree = body if body.static and body.spec is not None else tree_with_link(body, link)
        found = []
        for point in self.engine.contact_points(tree.number, tree.link_indices.get(link, BASE_INDEX)):
            name = self._names_by_number.get(point.number)
            if name is not None:
                other = self._bodies[name].link_of_number(point.number, point.index)
                found.append(ContactPoint(name, other, point.position, point.normal, -point.distance, point.force))
        return found

    def centre_of_mass(self, model: str, link: str) -> Vector3:
        """Returns the centre of mass of a link in the world [m]; the origin of a link that never moves.

        Raises:
            UnknownEntityError: There is no such model or link.
        """
        body = self.body(model)
        if body.static and body.spec is not None:
            return body.link_state(link).pose.position
        return centre_in_world(self.engine, body, link).position

    def reset_poses(self) -> None:
        """Puts every model where it first appeared, at rest; joints of models go to 0; forces of requests end."""
        self.forces.clear()
        self._let_go()
        for name, body in self._bodies.items():
            if body.spec is not None:
                body.reset_joints({})
                body.put_together(self._initial_poses[name])
        self.note_change()

    def instance(self, name: str) -> int:
        """Returns a number that no other model has or had, also after a restart.

        Raises:
            UnknownEntityError: There is no such model.
        """
        return self._instances[self.body(name).name]

    def restart(self) -> None:
        """Empties the engine, adds the models to keep, and starts time at 0; robots must load themselves."""
        self._let_go()
        self.settings, self.gravity = self._initial_physics
        self.engine.settings = self.settings
        self.engine.restart(self.gravity)
        self.forces.clear()
        self._bodies.clear()
        self._names_by_number.clear()
        self._forces.clear()
        self._initial_poses.clear()
        self._instances.clear()
        for model, prepared in self._initial:
            self.spawn(model, prepared)
        self.reset_time()
        self.note_change()

    def save_state(self) -> WorldState:
        """Returns the motion of everything, time and forces of requests, to continue from there once or more often.

        Not part of it: controllers and their commands, and settings that requests changed.
        """
        self.rest.disturb()  # as `restore_state` does, so that both go on alike
        forces = self.forces.saved()
        return WorldState(
            self.engine.save_state(), self._numbers(), tuple(self._welds), self._steps, self._time_ns, forces
        )

    def restore_state(self, state: WorldState) -> None:
        """Continues from a saved state, bit for bit as before.

        Raises:
            SimulationError: Models came, went or were made again since.
        """
        if state.numbers != self._numbers():
            raise SimulationError("the models have changed since the state was saved; restore it before they do")
        if state.welded != tuple(self._welds):
            raise SimulationError("what the hands hold has changed since the state was saved; restore it before")
        self.engine.restore_state(state.engine)
        self._steps = self._computed_until = state.steps
        self._time_ns = state.time_ns
        self.forces.restore(state.forces)
        self.note_change()

    def forget_state(self, state: WorldState) -> None:
        """Frees a saved state, which cannot be restored any more."""
        self.engine.forget_state(state.engine)

    def _numbers(self) -> dict[str, tuple[int, ...]]:
        return {name: tuple(part.number for part in body.parts) for name, body in self._bodies.items()}

    def reset_time(self) -> None:
        """Starts simulated time at 0 again."""
        self._steps = self._time_ns = self._computed_until = 0

    def close(self) -> None:
        """Closes the physics engine; may be called twice."""
        self.engine.close()

    def _set_properties(self, body: SimulatedBody, model: specs.Model) -> None:
        """Gives one tree of a model what its URDF does not say: surfaces, and how links and joints resist."""
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
