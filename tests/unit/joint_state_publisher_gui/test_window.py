# SPDX-License-Identifier: BSD-3-Clause
"""Input in the window moves the joints, and the window displays values that other components set."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from joint_sliders.joint_values import JointValues
from joint_sliders.slider_joints import SliderSettings, slider_joints
from joint_sliders.window import TICKS, SliderWindow
from python_qt_binding.QtWidgets import QApplication, QDoubleSpinBox, QPushButton, QSlider, QSpinBox

from modular_framework_urdf.robot import Robot


@pytest.fixture(scope="module")
def application() -> Iterator[QApplication]:
    yield QApplication([])


class Desk:
    """Window with its joint values; finds widgets by name."""

    def __init__(self, robot: Robot, rows: int = 0) -> None:
        joints = slider_joints(robot, SliderSettings(zeros={"turn": 0.12345}))
        self.values = JointValues(joints)
        self.window = SliderWindow("test", joints, self.values, rows)

    def find(self, kind: Any, name: str) -> Any:
        found = self.window.findChild(kind, name)
        assert found is not None, name
        return found

    def slider(self, joint: str) -> Any:
        return self.find(QSlider, f"{joint} slider")

    def number(self, joint: str) -> Any:
        return self.find(QDoubleSpinBox, f"{joint} number")


@pytest.fixture
def desk(application: QApplication, robot: Robot) -> Desk:
    return Desk(robot)


def test_each_independent_joint_with_a_range_has_a_slider(desk: Desk) -> None:
    sliders = {slider.objectName() for slider in desk.window.findChildren(QSlider)}
    assert sliders == {f"{name} slider" for name in ("lift", "turn", "wheel", "finger")}


def test_a_slider_moves_its_joint_between_the_limits(desk: Desk) -> None:
    desk.slider("turn").setValue(TICKS)
    assert desk.values.positions()["turn"] == 2.0 and desk.number("turn").value() == 2.0
    desk.slider("turn").setValue(0)
    assert desk.values.positions()["turn"] == -0.5
    desk.slider("lift").setValue(TICKS // 4)
    assert desk.values.positions()["lift"] == pytest.approx(0.2)


def test_a_typed_number_moves_the_joint(desk: Desk) -> None:
    desk.number("wheel").setValue(-1.234)
    assert desk.values.positions()["wheel"] == -1.234
    assert desk.slider("wheel").value() == round((3.14159265 - 1.234) / 6.2831853 * TICKS)


def test_displaying_a_position_does_not_round_it(desk: Desk) -> None:
    assert desk.values.positions()["turn"] == 0.12345
    desk.values.receive(["wheel"], [7.654321], [], [])
    desk.window.show_values()
    assert desk.values.positions()["wheel"] == 7.654321
    assert desk.number("wheel").value() == pytest.approx(7.654321 - 6.2831853, abs=1e-3), "shown within a turn"


def test_the_buttons_randomise_and_centre(desk: Desk) -> None:
    before = desk.values.positions()
    desk.find(QPushButton, "Randomize").click()
    moved = desk.values.positions()
    assert all(moved[name] != before[name] for name in ("lift", "turn", "wheel", "finger"))
    assert desk.number("turn").value() == pytest.approx(moved["turn"], abs=1e-3)
    desk.find(QPushButton, "Center").click()
    assert desk.values.positions() == before and desk.number("turn").value() == pytest.approx(0.12345, abs=1e-3)


def test_the_joints_per_column_can_be_changed(application: QApplication, robot: Robot) -> None:
    desk = Desk(robot, rows=2)
    desk.window.show()
    rows = desk.find(QSpinBox, "rows")

    def places() -> set[tuple[int, int]]:
        application.processEvents()
        return {(slider.parent().x(), slider.parent().y()) for slider in desk.window.findChildren(QSlider)}

    assert rows.value() == 2 and len({x for x, _ in places()}) == 2
    rows.setValue(4)
    assert len({x for x, _ in places()}) == 1 and len(places()) == 4
