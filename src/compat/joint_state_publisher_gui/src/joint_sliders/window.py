# SPDX-License-Identifier: BSD-3-Clause
"""The window: a slider and a number for each joint that is moved by hand, and buttons for all of them."""

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
"""Steps of a slider over its joint's range; numbers may be between two steps."""


@dataclass(frozen=True, slots=True)
class JointRow:
    """The widgets of a joint.

    Attributes:
        joint: The joint.
        widget: Holds the others.
        number: The position, which may be typed.
        slider: The position as a share of the range.
    """

    joint: SliderJoint
    widget: QWidget
    number: QDoubleSpinBox
    slider: QSlider

    def position(self, tick: int) -> float:
        """Returns the position [rad or m] of a step of the slider."""
        return self.joint.lower + (self.joint.upper - self.joint.lower) * tick / TICKS

    def show(self, position: float) -> None:
        """Shows a position [rad or m] without taking it for one that the user chose."""
        position = self.joint.shown(position)
        share = (position - self.joint.lower) / (self.joint.upper - self.joint.lower)
        for widget, value in ((self.number, position), (self.slider, round(share * TICKS))):
            widget.blockSignals(True)
            widget.setValue(value)
            widget.blockSignals(False)


class SliderWindow(QWidget):
    """The window.

    Args:
        title: Of the window.
        joints: The joints; those without a range have no slider.
        values: Where positions are read and set.
        rows: How many joints stand below each other; 0: all.
        generator: Of the random positions.
    """

    values_changed = Signal()
    """To be emitted, from any thread, when somebody else has set values."""

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
        """Shows the positions as they are now."""
        positions = self._values.positions()
        for row in self._rows:
            row.show(positions[row.joint.name])

    def _make_row(self, joint: SliderJoint, joints: SliderJoints) -> JointRow:
        widget, number, slider = QWidget(), QDoubleSpinBox(), QSlider(Qt.Horizontal)
        number.setObjectName(f"{joint.name} number")
        number.setDecimals(DECIMALS)
        number.setRange(joint.lower, joint.upper)
        number.setSingleStep((joint.upper - joint.lower) / 100)
        number.setSuffix(f" {joint.unit}")
        number.setKeyboardTracking(False)  # a number counts when it is typed to its end
        slider.setObjectName(f"{joint.name} slider")
        slider.setRange(0, TICKS)
        slider.setMinimumWidth(200)
        row = JointRow(joint, widget, number, slider)
        number.valueChanged.connect(lambda position: self._move(row, position))
        slider.valueChanged.connect(lambda tick: self._move(row, row.position(tick)))
        followers = [name for name, mimic in joints.following.items() if mimic.leader == joint.name]
        widget.setToolTip(
            f"{joint.name}: {joint.range_text}" + (f"; {', '.join(followers)} follow it" if followers else "")
        )
        _arrange(row)
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
        count = QSpinBox()
        count.setObjectName("rows")
        count.setPrefix("joints in a column: ")
        count.setRange(1, max(1, len(self._rows)))
        count.valueChanged.connect(self._place_rows)
        count.setValue(rows)
        layout.addWidget(count)
        self._place_rows(count.value())
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


def _arrange(row: JointRow) -> None:
    name = QLabel(f"<b>{row.joint.name}</b>")
    top, all_of_it = QHBoxLayout(), QVBoxLayout(row.widget)
    top.addWidget(name)
    top.addStretch()
    top.addWidget(row.number)
    bottom = QHBoxLayout()
    bottom.addWidget(QLabel(f"{row.joint.lower:.2f}"))
    bottom.addWidget(row.slider)
    bottom.addWidget(QLabel(f"{row.joint.upper:.2f}"))
    all_of_it.addLayout(top)
    all_of_it.addLayout(bottom)
    all_of_it.setContentsMargins(4, 2, 4, 2)


def _button(text: str, action: Callable[[], None]) -> QPushButton:
    button = QPushButton(text)
    button.setObjectName(text)
    button.clicked.connect(lambda _: action())
    return button
