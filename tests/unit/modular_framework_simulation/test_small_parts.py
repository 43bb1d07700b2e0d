# SPDX-License-Identifier: BSD-3-Clause
"""The parts around the world: pacing, requests from other threads, grasp detection, starting pose, meshes."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh

from modular_framework_simulation.errors import DescriptionError, LoopTimeoutError
from modular_framework_simulation.gazebo_ros.starting_pose import parse_starting_pose
from modular_framework_simulation.gazebo_ros.world_files import find_world_file
from modular_framework_simulation.loop.grasp_watch import GraspWatch
from modular_framework_simulation.loop.pacing import Pacer, RestSpeed
from modular_framework_simulation.loop.request_queue import RequestQueue
from modular_framework_simulation.models.mesh_files import ConvexParts, load_mesh
from modular_framework_simulation.models.sdf_specs import Mesh


class FakeTime:
    """Real time that passes only when somebody sleeps or works."""

    def __init__(self) -> None:
        self.now = 50.0

    def clock(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def test_the_pacer_holds_simulated_time_back_to_real_time_and_sleeps_seldom() -> None:
    time, sleeps = FakeTime(), []
    pacer = Pacer(1.0, time.clock, lambda duration_s: (sleeps.append(duration_s), time.sleep(duration_s)))
    for step in range(1, 601):
        time.now += 0.0005
        pacer.keep(step * 0.002)
        assert -1e-9 <= step * 0.002 - (time.now - 50.0) <= 0.008 + 1e-9
    assert len(sleeps) <= 600 / 5
    report = pacer.report(1.2)
    assert report.factor == pytest.approx(1.0)
    assert report.busy_fraction == pytest.approx(0.25)
    assert report.step_cost_s == pytest.approx(0.0005)


def test_while_the_robot_stands_still_the_pacer_sleeps_half_as_often_and_keeps_the_rate() -> None:
    time, sleeps = FakeTime(), []
    pacer = Pacer(1.0, time.clock, lambda duration_s: (sleeps.append(duration_s), time.sleep(duration_s)))
    for step in range(1, 601):
        time.now += 0.0005
        pacer.keep(step * 0.002, calm=True)
        assert -1e-9 <= step * 0.002 - (time.now - 50.0) <= 0.018 + 1e-9
    assert len(sleeps) <= 600 / 10
    assert time.now == pytest.approx(51.2, abs=0.018)


def test_the_pacer_makes_good_a_short_stall_and_forgives_a_long_one() -> None:
    time = FakeTime()
    pacer = Pacer(1.0, time.clock, time.sleep)
    time.now += 0.5
    for step in range(1, 1001):
        pacer.keep(step * 0.002)
    assert time.now == pytest.approx(52.0, abs=0.008)
    time.now += 60.0
    for step in range(1001, 2001):
        pacer.keep(step * 0.002)
    assert time.now == pytest.approx(52.0 + 60.0 + 1.0, abs=0.015)


def test_a_factor_of_two_runs_twice_as_fast_and_zero_never_sleeps() -> None:
    time = FakeTime()
    Pacer(2.0, time.clock, time.sleep).keep(1.0)
    assert time.now == pytest.approx(50.5)
    Pacer(0.0, time.clock, time.sleep).keep(100.0)
    assert time.now == pytest.approx(50.5)
    with pytest.raises(ValueError, match="allowed"):
        Pacer(-1.0)


def test_time_that_nobody_waits_for_may_pass_at_another_pace() -> None:
    time = FakeTime()
    pacer = Pacer(0.0, time.clock, time.sleep, idle_limit=1.0)
    pacer.keep(1.0, idle=True)
    pacer.keep(1.2, idle=True)
    assert time.now == pytest.approx(50.2)
    pacer.keep(100.0)
    assert time.now == pytest.approx(50.2)
    pacer.keep(100.1, idle=True)
    pacer.keep(100.3, idle=True)
    assert time.now == pytest.approx(50.4)


def test_as_fast_as_possible_leaves_busy_processors_to_nodes_while_the_robot_stands_still() -> None:
    time, idle_processors, idle_s = FakeTime(), 0.0, [0.0]

    def simulated_in(real_s: float) -> float:
        begun, steps = time.now, 0
        while time.now - begun < real_s:
            steps += 1
            before = time.now
            pacer.keep(simulated[0] + steps * 0.01, still=True)
            idle_s[0] += (time.now - before) * idle_processors
        simulated[0] += steps * 0.01
        return steps * 0.01

    simulated = [0.0]
    pacer = Pacer(0.0, time.clock, time.sleep, rest_speed=RestSpeed(lambda: idle_s[0]))
    assert simulated_in(2.0) == pytest.approx(2.0, abs=0.1)
    idle_processors = 1.0
    simulated_in(1.0)
    assert simulated_in(1.0) > 50.0
    idle_processors = 0.0
    simulated_in(2.0)
    assert simulated_in(1.0) == pytest.approx(1.0, abs=0.1)
    idle_processors = 1.0
    simulated_in(1.0)
    begun = time.now
    pacer.keep(simulated[0] + 500.0)
    assert time.now == begun
    assert simulated_in(0.1) < 0.5


def test_what_arrives_while_the_loop_sleeps_is_carried_out_at_once_and_the_sleep_goes_on() -> None:
    requests = RequestQueue()
    answers: list[float] = []

    def ask() -> None:
        begun_s = time.monotonic()
        requests.call("now", lambda: None, 5.0)
        answers.append(time.monotonic() - begun_s)

    threads = [threading.Timer(delay_s, ask) for delay_s in (0.05, 0.1)]
    begun_s = time.monotonic()
    for thread in threads:
        thread.start()
    requests.serve(0.5)
    assert time.monotonic() - begun_s >= 0.5
    assert len(answers) == 2
    assert max(answers) < 0.3


def test_requests_are_carried_out_by_the_loops_thread_and_errors_come_back() -> None:
    requests, stop, threads = RequestQueue(), threading.Event(), []

    def loop() -> None:
        while not stop.is_set():
            requests.wait(0.05)
            requests.run_pending()

    def fail() -> None:
        raise KeyError("told")

    thread = threading.Thread(target=loop)
    thread.start()
    try:
        requests.call("name", lambda: threads.append(threading.current_thread()), 5.0)
        assert threads == [thread]
        with pytest.raises(KeyError, match="told"):
            requests.call("failing", fail, 5.0)
    finally:
        stop.set()
        thread.join(5.0)


def test_a_request_nobody_gets_to_times_out_and_is_never_done_later() -> None:
    requests, done = RequestQueue(), []
    with pytest.raises(LoopTimeoutError, match=r"'spawn' within 0\.01 s"):
        requests.call("spawn", lambda: done.append(1), 0.01)
    requests.run_pending()
    assert done == []


def test_an_object_is_held_after_two_fingers_touched_it_for_a_while() -> None:
    watch = GraspWatch(hold_after_s=0.2, release_after_s=0.3)
    assert watch.update(0.0, [{"cube"}, {"cube"}]) is None
    assert watch.update(0.1, [{"cube"}, {"cube", "ball"}]) is None
    assert watch.update(0.2, [{"cube"}, {"cube"}]) == "cube"


def test_one_finger_is_no_grasp_and_an_interrupted_touch_starts_again() -> None:
    watch = GraspWatch(0.2, 0.3)
    for time_s in (0.0, 0.5, 1.0):
        assert watch.update(time_s, [{"cube"}, {"can"}]) is None
    watch.update(1.1, [{"cube"}, {"cube"}])
    watch.update(1.2, [{"cube"}, set()])
    assert watch.update(1.31, [{"cube"}, {"cube"}]) is None
    assert watch.update(1.52, [{"cube"}, {"cube"}]) == "cube"


def test_an_object_is_let_go_only_after_a_finger_missed_it_for_a_while() -> None:
    watch = GraspWatch(0.0, 0.3)
    assert watch.update(0.0, [{"cube"}, {"cube"}]) == "cube"
    assert watch.update(0.1, [{"cube"}, set()]) == "cube"
    assert watch.update(0.2, [{"cube"}, {"cube"}]) == "cube"
    assert watch.update(0.3, [set(), set()]) == "cube"
    assert watch.update(0.61, [set(), set()]) is None


def test_a_starting_pose_is_read_as_spawn_model_writes_it() -> None:
    assert parse_starting_pose("-J a 1.5 -J b -2") == {"a": 1.5, "b": -2.0}
    assert parse_starting_pose("") == {}


@pytest.mark.parametrize("text", ["a 1", "-J a", "-J a b", "-J a 1 -J a 2", "-J a nan", "-j a 1"])
def test_a_wrong_starting_pose_is_refused(text: str) -> None:
    with pytest.raises(DescriptionError, match="starting pose, word"):
        parse_starting_pose(text)


def volume_of(files: tuple[Path, ...]) -> float:
    return sum(trimesh.load(file, force="mesh").volume for file in files)


def test_a_mesh_that_is_not_convex_is_cut_into_convex_parts_of_its_volume(tmp_path: Path) -> None:
    ring = trimesh.creation.annulus(r_min=0.03, r_max=0.05, height=0.02, sections=16)
    file = tmp_path / "ring.stl"
    ring.export(file)
    parts = ConvexParts(tmp_path / "cache")
    files = parts.parts(Mesh(file))
    assert len(files) >= 4
    assert all(trimesh.load(each, force="mesh").is_convex for each in files)
    assert volume_of(files) == pytest.approx(ring.volume, rel=0.15)
    assert trimesh.load(parts.hull(Mesh(file)), force="mesh").volume > 1.3 * ring.volume


def test_a_fine_mesh_is_simplified_before_it_is_cut_into_convex_parts_of_its_volume(tmp_path: Path) -> None:
    block, groove = trimesh.creation.box((0.1, 0.06, 0.05)), trimesh.creation.box((0.08, 0.1, 0.05))
    channel = block.difference(groove.apply_translation((0.0, 0.0, 0.01)))
    file = tmp_path / "channel.stl"
    channel.subdivide(iterations=5).export(file)
    said: list[str] = []
    files = ConvexParts(tmp_path / "cache", said.append).parts(Mesh(file))
    assert f"channel.stl with 28,672 triangles, simplified to {len(channel.faces)}, into convex parts" in said[0]
    assert volume_of(files) == pytest.approx(channel.volume, rel=0.01)


def test_convex_parts_of_an_open_mesh_are_no_larger_than_it(tmp_path: Path) -> None:
    ring = trimesh.creation.annulus(r_min=0.3, r_max=0.5, height=0.2, sections=8)
    ring.update_faces(np.arange(len(ring.faces)) > 1)
    file = tmp_path / "ring.stl"
    ring.export(file)
    said: list[str] = []
    files = ConvexParts(tmp_path / "cache", said.append).parts(Mesh(file))
    corners = np.concatenate([trimesh.load(each, force="mesh").vertices for each in files])
    assert np.ptp(corners, axis=0) == pytest.approx(np.ptp(ring.vertices, axis=0), abs=1e-3)
    assert all(trimesh.load(each, force="mesh").is_convex for each in files)
    assert len(files) >= 4
    assert "ring.stl with 62 triangles into convex parts" in said[0]


def test_convex_parts_come_from_the_cache_and_follow_content_and_scale(tmp_path: Path) -> None:
    file = tmp_path / "box.stl"
    trimesh.creation.box((0.1, 0.1, 0.1)).export(file)
    parts = ConvexParts(tmp_path / "cache")
    first = parts.parts(Mesh(file))
    written = first[0].stat().st_mtime_ns
    assert len(first) == 1
    assert parts.parts(Mesh(file))[0].stat().st_mtime_ns == written
    assert volume_of(parts.parts(Mesh(file, (2.0, 1.0, 1.0)))) == pytest.approx(0.002)
    trimesh.creation.box((0.2, 0.1, 0.1)).export(file)
    assert volume_of(parts.parts(Mesh(file))) == pytest.approx(0.002)


def test_an_exact_mesh_keeps_its_triangles_and_a_broken_one_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "box.obj"
    trimesh.creation.box((1, 1, 1)).export(file)
    mesh = load_mesh(Mesh(file, (2.0, 1.0, 1.0)))
    assert mesh.triangles.shape == (12, 3)
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx((2, 1, 1))
    broken = tmp_path / "broken.stl"
    broken.write_text("this is no mesh")
    with pytest.raises(DescriptionError, match=r"broken\.stl"):
        load_mesh(Mesh(broken))


def test_a_world_is_found_by_path_along_gazebos_variable_and_among_our_own(tmp_path: Path) -> None:
    for folder in ("first", "own"):
        (tmp_path / folder / "worlds").mkdir(parents=True)
    own = tmp_path / "own" / "worlds" / "empty.world"
    own.touch()
    folders = [tmp_path / "nowhere", tmp_path / "first", tmp_path / "own"]
    assert find_world_file("worlds/empty.world", folders) == own
    users = tmp_path / "first" / "worlds" / "empty.world"
    users.touch()
    assert find_world_file("worlds/empty.world", folders) == users
    assert find_world_file(str(own), []) == own
    with pytest.raises(DescriptionError, match=r"moon\.world: cannot be read: .* looked for .*GAZEBO_RESOURCE_PATH"):
        find_world_file("moon.world", folders)


def test_another_pace_counts_from_the_next_step() -> None:
    time = FakeTime()
    pacer = Pacer(1.0, time.clock, time.sleep)
    pacer.keep(1.0)
    pacer.set_factor(2.0)
    pacer.keep(1.5)
    pacer.keep(2.5)
    assert time.now == pytest.approx(51.5)
    pacer.reset_factor()
    assert pacer.real_time_factor == 1.0
    with pytest.raises(ValueError, match="allowed"):
        pacer.set_factor(float("nan"))
