# SPDX-License-Identifier: BSD-3-Clause
"""Trials of the laws of mechanics: a measured value of a simulated world, and the value of the law."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState, Twist
from modular_framework_testing.simulation.simulated_samples import hinged_model, run
from modular_framework_urdf.rotations import Vector3, rotate_vector

G = 9.81
FLAT_MOMENTS = (0.0035, 0.0035, 0.0067)  # of 1 kg in a box of 0.2 x 0.2 x 0.04 m [kg m^2]
MakeWorld = Callable[[], PhysicsWorld]


@dataclass(frozen=True, slots=True)
class Outcome:
    """The measured value of a trial, and the value of the law."""

    measured: float
    expected: float

    @property
    def error(self) -> float:
        """Relative error."""
        return abs(self.measured / self.expected - 1.0)


@dataclass(frozen=True, slots=True)
class Surface:
    """Friction coefficient and restitution of a body."""

    mu: float = 0.8
    bounce: float = 0.0


ROUGH = Surface()


def inertia(moments: Vector3, mass: float = 1.0) -> specs.Inertial:
    """Returns the inertia of a mass [kg] with principal moments about the frame's axes [kg m^2]."""
    x, y, z = moments
    return specs.Inertial(Pose(), mass, (x, 0, 0, y, 0, z))


def part(
    name: str,
    shape: specs.Geometry,
    pose: Pose,
    inertial: specs.Inertial,
    surface: Surface = ROUGH,
    *,
    static: bool = False,
) -> specs.Model:
    """Returns a body with one shape.

    Args:
        name: Name of the model.
        shape: Shape.
        pose: Pose in the world.
        inertial: Mass and moments of inertia.
        surface: Friction and restitution.
        static: Whether the body never moves.
    """
    collision = specs.Collision("shape", Pose(), shape, specs.Friction(surface.mu), specs.Bounce(surface.bounce, 0.0))
    return specs.Model(name, pose, static, (specs.Link("link", Pose(), inertial, (collision,), ()),), (), "law")


def box(name: str, side: float, pose: Pose, mass: float = 1.0) -> specs.Model:
    """Returns a cube.

    Args:
        name: Name of the model.
        side: Edge length [m].
        pose: Pose in the world.
        mass: Mass [kg].
    """
    return part(name, specs.Box((side,) * 3), pose, inertia((mass * side**2 / 6,) * 3, mass))


def slope(angle: float, mu: float) -> tuple[specs.Model, Pose]:
    """Returns a slope that goes down towards x, and the pose of its surface's centre."""
    pose = Pose.from_xyz_rpy((0, 0, 3), (0, angle, 0))
    body = part("slope", specs.Box((8, 2, 0.1)), pose, inertia((1, 1, 1)), Surface(mu), static=True)
    return body, pose @ Pose((0, 0, 0.05))


def free_fall(make: MakeWorld) -> Outcome:
    """A fall of one second covers g t^2 / 2."""
    world = make()
    body = world.spawn(box("cube", 0.05, Pose((0, 0, 8))))
    run(world, 1.0)
    return Outcome(8 - body.state().pose.position[2], G / 2)


def slide(make: MakeWorld) -> Outcome:
    """A box with the speed v stops after v^2 / (2 mu g)."""
    world, speed, mu = make(), 2.0, 0.4
    ground, top = slope(0.0, mu)
    world.spawn(ground)
    flat = part("box", specs.Box((0.2, 0.2, 0.04)), top @ Pose((-2, 0, 0.02)), inertia(FLAT_MOMENTS), Surface(mu))
    body = world.spawn(flat)
    run(world, 0.2)
    begin = body.state().pose.position
    world.set_state("box", BodyState(body.state().pose, Twist((speed, 0, 0))))
    run(world, 2.0)
    return Outcome(body.state().pose.position[0] - begin[0], speed**2 / (2 * mu * G))


def roll_down_slope(
    make: MakeWorld, shape: specs.Geometry, moments: Vector3, turn: Vector3, inertia_ratio: float
) -> Outcome:
    """Measures the distance down a slope of 10 degrees in one second.

    Args:
        make: Returns an empty world.
        shape: Shape of the roller, with a radius of 0.05 m.
        moments: Principal moments of inertia for 1 kg [kg m^2].
        turn: Orientation of the shape at the start, as roll, pitch and yaw [rad].
        inertia_ratio: I / (m r^2).
    """
    world, angle, radius = make(), math.radians(10), 0.05
    ground, top = slope(angle, 0.8)
    world.spawn(ground)
    start = top @ Pose((-2, 0, radius)) @ Pose.from_xyz_rpy((0, 0, 0), turn)
    body = world.spawn(part("roller", shape, start, inertia(moments)))
    run(world, 1.0)
    way = math.dist(body.state().pose.position, start.position)
    return Outcome(way, G * math.sin(angle) / (1 + inertia_ratio) / 2)


def roll_cylinder(make: MakeWorld) -> Outcome:
    """A cylinder rolls down a slope with two thirds of the acceleration of sliding."""
    across, along = 1 * (3 * 0.05**2 + 0.1**2) / 12, 0.05**2 / 2
    shape = specs.Cylinder(0.05, 0.1)
    return roll_down_slope(make, shape, (across, across, along), (math.pi / 2, 0, 0), 0.5)


def roll_ball(make: MakeWorld) -> Outcome:
    """A ball rolls down a slope with five sevenths of the acceleration of sliding."""
    return roll_down_slope(make, specs.Sphere(0.05), (0.4 * 0.05**2,) * 3, (0, 0, 0), 0.4)


def bounce_on_floor(make: MakeWorld, shape: specs.Geometry, half: float, moment: float) -> Outcome:
    """Measures the ratio of the velocities after and before an impact with restitution 0.8.

    Args:
        make: Returns an empty world.
        shape: Shape of the body.
        half: Height of the centre of the resting body [m].
        moment: Moment of inertia about each axis [kg m^2].
    """
    world, bounce = make(), 0.8
    surface = Surface(bounce=bounce)
    world.spawn(part("slab", specs.Box((1, 1, 1)), Pose(), inertia((1, 1, 1)), surface, static=True))
    body = world.spawn(part("body", shape, Pose((0, 0, 0.5 + half + 0.5)), inertia((moment,) * 3), surface))
    before = 0.0
    while (velocity := body.state().twist.linear[2]) <= before:
        before = velocity
        world.step()
    after = velocity
    for _ in range(50):
        world.step()
        after = max(after, body.state().twist.linear[2])
    return Outcome(-after / before, bounce)


def bounce_ball(make: MakeWorld) -> Outcome:
    """A ball of restitution 0.8 leaves with 0.8 of its velocity."""
    return bounce_on_floor(make, specs.Sphere(0.05), 0.05, 0.4 * 0.05**2)


def bounce_box(make: MakeWorld) -> Outcome:
    """A box of restitution 0.8 that falls flat leaves with 0.8 of its velocity."""
    return bounce_on_floor(make, specs.Box((0.1, 0.1, 0.1)), 0.05, 0.1**2 / 6)


def pendulum(make: MakeWorld) -> Outcome:
    """A pendulum has the period 2 pi sqrt(I / (m g l)) (1 + a^2 / 16)."""
    world, length, amplitude = make(), 0.4, 0.1
    body = world.spawn(hinged_model("pendulum", length, pose=Pose((0, 0, 2))))
    body.set_joints({"hinge": math.pi / 2 - amplitude})
    crossings: list[float] = []
    step_s, before = world.settings.time_step_s, 0.0
    while len(crossings) < 5:
        world.step()
        x, _, z = body.link_state("bob").pose.position
        angle = math.atan2(-x, 2 - z)
        if before * angle < 0:
            crossings.append(world.time_ns * 1e-9 - step_s * angle / (angle - before))
        before = angle
    period = 2 * math.pi * math.sqrt((0.001 + 0.5 * length**2) / (0.5 * G * length)) * (1 + amplitude**2 / 16)
    return Outcome((crossings[4] - crossings[0]) / 2, period)


def top(make: MakeWorld) -> Outcome:
    """A spinning top without friction turns about the vertical with the rate of Lagrange's steady precession."""
    world, mass, height, radius, tilt, spin = make(), 0.5, 0.06, 0.004, 0.3, 150.0
    axial, across = 4e-4, 3e-4
    arm = height * mass * G  # torque per sine of the tilt, about the centre: the floor's push m g at the tip
    # I1 W^2 cos(t) - I3 s W + m g h = 0; the slow root
    root = math.sqrt((axial * spin) ** 2 - 4 * across * math.cos(tilt) * arm)
    rate = (axial * spin - root) / (2 * across * math.cos(tilt))
    tip = specs.Collision("tip", Pose((0, 0, -height)), specs.Sphere(radius), specs.Friction(0.0))
    inertial = specs.Inertial(Pose(), mass, (across, 0, 0, across, 0, axial))
    pose = Pose.from_xyz_rpy((0, 0, height * math.cos(tilt) + radius), (0, tilt, 0))
    model = specs.Model("top", pose, False, (specs.Link("link", Pose(), inertial, (tip,), ()),), (), "law")
    body = world.spawn(model)
    axis = rotate_vector(pose.quaternion, (0.0, 0.0, 1.0))
    own = spin - rate * math.cos(tilt)  # total spin about the axis is `spin`
    angular = (own * axis[0], 0.0, own * axis[2] + rate)
    world.set_state("top", BodyState(pose, Twist((0, 0, 0), angular)))
    turned, before = 0.0, 0.0
    seconds = 3.0
    for _ in range(round(seconds / world.settings.time_step_s)):
        world.step()
        x, y, _ = rotate_vector(body.state().pose.quaternion, (0.0, 0.0, 1.0))
        angle = math.atan2(y, x)
        turned += (angle - before + math.pi) % (2 * math.pi) - math.pi
        before = angle
    return Outcome(turned / seconds, rate)


def stack(make: MakeWorld, seconds: float = 10.0) -> Outcome:
    """Ten cubes on each other stand: the highest keeps its position, to a fraction of one cube.

    Args:
        make: Makes a world with a floor.
        seconds: Simulated time [s].
    """
    world, side = make(), 0.05
    bodies = [world.spawn(box(f"cube_{n}", side, Pose((0, 0, side * (n + 0.5))))) for n in range(10)]
    run(world, seconds)
    x, y, z = bodies[-1].state().pose.position
    return Outcome(side - math.dist((x, y, z), (0, 0, 9.5 * side)), side)


def heavy_on_light(make: MakeWorld, seconds: float = 5.0) -> Outcome:
    """A body of 100 kg stands on a body of 0.1 kg: both keep their positions, to a fraction of their sides.

    Args:
        make: Makes a world with a floor.
        seconds: Simulated time [s].
    """
    world, side = make(), 0.1
    light = world.spawn(box("light", side, Pose((0, 0, side / 2)), mass=0.1))
    heavy = world.spawn(box("heavy", side, Pose((0, 0, 1.5 * side)), mass=100.0))
    run(world, seconds)
    off = max(
        math.dist(body.state().pose.position, (0, 0, height))
        for body, height in ((light, 0.5 * side), (heavy, 1.5 * side))
    )
    return Outcome(side - off, side)


def friction_cone(make: MakeWorld) -> Outcome:
    """A box begins to slip on a slope whose tangent is the coefficient of friction."""
    mu, low, high = 0.5, 0.8, 1.2
    while high - low > 0.005:
        middle = (low + high) / 2
        world = make()
        ground, top_pose = slope(math.atan(mu * middle), mu)
        world.spawn(ground)
        start = top_pose @ Pose((0, 0, 0.02))
        body = world.spawn(part("box", specs.Box((0.2, 0.2, 0.04)), start, inertia(FLAT_MOMENTS), Surface(mu)))
        run(world, 1.0)
        slips = math.dist(body.state().pose.position, start.position) > 0.004
        low, high = (low, middle) if slips else (middle, high)
    return Outcome(mu * (low + high) / 2, mu)


TRIALS = (
    free_fall, slide, roll_cylinder, roll_ball, bounce_ball, bounce_box, pendulum, top, stack, heavy_on_light,
    friction_cone,
)  # fmt: skip
