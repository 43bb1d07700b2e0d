# SPDX-License-Identifier: BSD-3-Clause
"""Window with a slider and a spin box per independent joint, and buttons that move all joints."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

from python_qt_binding.QtCore import Qt, Signal
from python_qt_binding.QtWidgets import (
    QDoubleSpinBox,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QScrollArea,
    QSlider,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from joint_sliders.joint_values import JointValues
from joint_sliders.slider_joints import DECIMALS, SliderJoint, SliderJoints

TICKS = 10000
"""Slider steps over the range of a joint; typed positions are not rounded to a step."""


@dataclass(frozen=True, slots=True)
class JointRow:
    """Widgets of a joint.

    Attributes:
        joint: Displayed joint.
        widget: Parent widget of the row.
        spin_box: Spin box with the position.
        slider: Slider with the position as a fraction of the range.
    """

    joint: SliderJoint
    widget: QWidget
    spin_box: QDoubleSpinBox
    slider: QSlider

    def position(self, tick: int) -> float:
        """Returns the position [rad or m] at a slider step."""
        return self.joint.lower + (self.joint.upper - self.joint.lower) * tick / TICKS

    def show(self, position: float) -> None:
        """Displays a position [rad or m] without emitting `valueChanged`."""
        position = self.joint.shown_position(position)
        fraction = (position - self.joint.lower) / (self.joint.upper - self.joint.lower)
        for widget, value in ((self.spin_box, position), (self.slider, round(fraction * TICKS))):
            widget.blockSignals(True)
            widget.setValue(value)
            widget.blockSignals(False)


class SliderWindow(QWidget):
    """Main window of joint_state_publisher_gui.

    Args:
        title: Window title.
        joints: Joints of the robot; joints that cannot move have no slider.
        values: Joint values shared with the publisher.
        rows: Joints per column; 0 for a single column.
        generator: Random number generator of the button `Randomize`.
    """

    values_changed = Signal()
    """Emit this signal, from any thread, after another component has changed the values."""

    def __init__(
        self,
        title: str,
        joints: SliderJoints,
        values: JointValues,
        rows: int = 0,
        generator: random.Random | None = None,
    ) -> None:
        super().__init__()
        self.setWindowTitle(title)
        self._values = values
        self._generator = generator or random.Random()
        self._rows = [self._make_row(joint, joints) for joint in joints.free.values() if joint.has_range]
        self._grid = QGridLayout()
        self._make_layout(rows or len(self._rows))
        self.values_changed.connect(self.show_values)
        self.show_values()

    def show_values(self) -> None:
        """Displays the current positions."""
        positions = self._values.positions()
        for row in self._rows:
            row.show(positions[row.joint.name])

    def _make_row(self, joint: SliderJoint, joints: SliderJoints) -> JointRow:
        widget, spin_box, slider = QWidget(), QDoubleSpinBox(), QSlider(Qt.Horizontal)
        spin_box.setObjectName(f"{joint.name} number")
        spin_box.setDecimals(DECIMALS)
        spin_box.setRange(joint.lower, joint.upper)
        spin_box.setSingleStep((joint.upper - joint.lower) / 100)
        spin_box.setSuffix(f" {joint.unit}")
        spin_box.setKeyboardTracking(False)  # report a typed value on Enter, not on every key
        slider.setObjectName(f"{joint.name} slider")
        slider.setRange(0, TICKS)
        slider.setMinimumWidth(200)
        row = JointRow(joint, widget, spin_box, slider)
        spin_box.valueChanged.connect(lambda position: self._move(row, position))
        slider.valueChanged.connect(lambda tick: self._move(row, row.position(tick)))
        mimic_joints = [name for name, mimic in joints.following.items() if mimic.leader == joint.name]
        widget.setToolTip(
            f"{joint.name}: {joint.range_text}" + (f"; mimic joints: {', '.join(mimic_joints)}" if mimic_joints else "")
        )
        _lay_out(row)
        return row

    def _move(self, row: JointRow, position: float) -> None:
        self._values.set_position(row.joint.name, position)
        row.show(position)

    def _make_layout(self, rows: int) -> None:
        layout = QVBoxLayout(self)
        area, content = QScrollArea(), QWidget()
        content.setLayout(self._grid)
        area.setWidgetResizable(True)
        area.setWidget(content)
        area.setMinimumWidth(300)
        layout.addWidget(area)
        layout.addWidget(_button("Randomize", self._randomise))
        layout.addWidget(_button("Center", self._centre))
        rows_box = QSpinBox()
        rows_box.setObjectName("rows")
        rows_box.setPrefix("joints per column: ")
        rows_box.setRange(1, max(1, len(self._rows)))
        rows_box.valueChanged.connect(self._place_rows)
        rows_box.setValue(rows)
        layout.addWidget(rows_box)
        self._place_rows(rows_box.value())
        area.setMinimumHeight(min(content.sizeHint().height() + 4, 700))

    def _place_rows(self, rows: int) -> None:
        for index, row in enumerate(self._rows):
            self._grid.addWidget(row.widget, index % rows, index // rows)

    def _randomise(self) -> None:
        self._values.randomise(self._generator)
        self.show_values()

    def _centre(self) -> None:
        self._values.centre()
        self.show_values()


def _lay_out(row: JointRow) -> None:
    name = QLabel(f"<b>{row.joint.name}</b>")
    top, row_layout = QHBoxLayout(), QVBoxLayout(row.widget)
    top.addWidget(name)
    top.addStretch()
    top.addWidget(row.spin_box)
    bottom = QHBoxLayout()
    bottom.addWidget(QLabel(f"{row.joint.lower:.2f}"))
    bottom.addWidget(row.slider)
    bottom.addWidget(QLabel(f"{row.joint.upper:.2f}"))
    row_layout.addLayout(top)
    row_layout.addLayout(bottom)
    row_layout.setContentsMargins(4, 2, 4, 2)


def _button(text: str, action: Callable[[], None]) -> QPushButton:
    button = QPushButton(text)
    button.setObjectName(text)
    button.clicked.connect(lambda _: action())
    return button
