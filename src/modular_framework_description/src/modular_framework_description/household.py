# SPDX-License-Identifier: BSD-3-Clause
"""Household objects of which size, mass and friction were measured and published.

Two tables are the sources:

- `GRASP_TABLE`: 21 everyday objects with dimensions, mass, offset of the centre of mass, and static and dynamic
  coefficients of friction, all determined by experiment. The static coefficient is used. Left out are those that no
  boxes, cylinders and spheres describe (propeller, paper ball, keys, bulb, cup, roll of tape).
- `YCB_TABLE`: dimensions and masses of the YCB objects. It has no friction: that of the object of `GRASP_TABLE` with
  the like surface stands for it (tin: the can, carton: the matchbox, plastic: the remote control), and for foam the
  0.54 that the notes of github.com/utiasDSL/upright give for a foam die on a tray.

Shapes are primitives of the measured outer dimensions, filled evenly; where an offset of the centre of mass was
measured, the centre is moved by it. Objects lie or stand as they do on a table, longest edge along x where they lie.
"""

from __future__ import annotations

import math

from modular_framework_description.solids import Body, Part

GRASP_TABLE = (
    "Development of Grasps, 4.1.2, table 4.1, 9dok.net/article/object-characteristics-development-of-grasps.qo5gdmpj"
)
YCB_TABLE = "Calli et al., The YCB Object and Model Set, IEEE Robotics & Automation Magazine 22(3), 2015, table 1"

_TIN, _CARTON, _PLASTIC, _FOAM = 0.23, 0.48, 0.40, 0.54
_ALONG_X = (0.0, math.pi / 2.0, 0.0)


def _object(
    name: str,
    what: str,
    mass_g: float,
    part: Part,
    friction: float,
    colour: tuple[float, float, float],
    source: str,
    offset_mm: float = 0.0,
) -> Body:
    """Returns an object of one shape; `offset_mm` is that of its centre of mass along x."""
    description = f"{what} Source: {source}."
    return Body(
        name,
        description,
        mass_g / 1000.0,
        (part,),
        friction,
        colour=colour,
        centre_offset=(offset_mm / 1000.0, 0.0, 0.0),
    )


def _box(x_mm: float, y_mm: float, z_mm: float) -> Part:
    return Part("box", (x_mm / 1000.0, y_mm / 1000.0, z_mm / 1000.0))


def _standing(diameter_mm: float, height_mm: float) -> Part:
    return Part("cylinder", (diameter_mm / 2000.0, height_mm / 1000.0))


def _lying(diameter_mm: float, length_mm: float) -> Part:
    return Part("cylinder", (diameter_mm / 2000.0, length_mm / 1000.0), rpy=_ALONG_X)


def _sphere(diameter_mm: float) -> Part:
    return Part("sphere", (diameter_mm / 2000.0,))


_FROM_GRASP_TABLE = (
    _object("toy_cube", "A toy cube.", 12.2, _box(31.0, 31.0, 31.0), 0.31, (0.80, 0.20, 0.15), GRASP_TABLE),
    _object("drinks_can", "A full drinks can.", 368.0, _standing(65.8, 115.6), 0.23, (0.70, 0.72, 0.75), GRASP_TABLE),
    _object("tissue_pack", "A pack of tissues.", 25.7, _box(107.0, 53.0, 25.0), 0.35, (0.90, 0.92, 0.95), GRASP_TABLE),
    _object("tennis_ball", "A tennis ball.", 58.4, _sphere(66.0), 0.79, (0.80, 0.90, 0.20), GRASP_TABLE),
    _object("sharpener", "A pencil sharpener.", 24.4, _standing(36.6, 57.0), 0.44, (0.15, 0.45, 0.70), GRASP_TABLE),
    _object(
        "remote_control",
        "A remote control.",
        145.9,
        _box(165.0, 50.0, 40.0),
        0.40,
        (0.15, 0.15, 0.17),
        GRASP_TABLE,
        offset_mm=11.0,
    ),
    _object(
        "board_marker",
        "A marker for whiteboards.",
        16.8,
        _lying(17.8, 140.0),
        0.44,
        (0.10, 0.20, 0.55),
        GRASP_TABLE,
        offset_mm=2.0,
    ),
    _object("tea_light", "A tea light.", 13.5, _standing(38.0, 16.5), 0.30, (0.85, 0.85, 0.88), GRASP_TABLE),
    _object("golf_ball", "A golf ball.", 45.7, _sphere(42.7), 0.25, (0.95, 0.95, 0.95), GRASP_TABLE),
    _object("matchbox", "A box of matches.", 7.2, _box(52.0, 37.0, 13.5), 0.48, (0.75, 0.55, 0.30), GRASP_TABLE),
    _object("chocolate_bar", "A chocolate bar.", 55.7, _box(101.0, 30.5, 22.0), 0.30, (0.40, 0.22, 0.12), GRASP_TABLE),
    _object("folding_rule", "A folding rule.", 101.4, _box(235.0, 16.4, 39.0), 0.31, (0.90, 0.80, 0.30), GRASP_TABLE),
    _object(
        "voltage_tester",
        "A voltage tester.",
        16.9,
        _box(139.3, 17.5, 15.0),
        0.26,
        (0.85, 0.35, 0.10),
        GRASP_TABLE,
        offset_mm=11.5,
    ),
    _object("eraser", "An eraser.", 17.9, _box(49.0, 10.3, 24.2), 1.1, (0.85, 0.85, 0.90), GRASP_TABLE),
    _object("pencil", "A pencil.", 4.4, _box(175.0, 7.6, 6.9), 0.30, (0.90, 0.70, 0.15), GRASP_TABLE, offset_mm=5.5),
)

_FROM_YCB_TABLE = (
    _object(
        "cracker_box", "A box of crackers.", 411.0, _box(60.0, 158.0, 210.0), _CARTON, (0.75, 0.15, 0.10), YCB_TABLE
    ),
    _object("sugar_box", "A box of sugar.", 514.0, _box(38.0, 89.0, 175.0), _CARTON, (0.90, 0.85, 0.20), YCB_TABLE),
    _object(
        "pudding_box",
        "A box of pudding powder.",
        187.0,
        _box(110.0, 89.0, 35.0),
        _CARTON,
        (0.45, 0.25, 0.12),
        YCB_TABLE,
    ),
    _object(
        "gelatin_box", "A box of gelatin powder.", 97.0, _box(85.0, 28.0, 73.0), _CARTON, (0.80, 0.20, 0.30), YCB_TABLE
    ),
    _object("tomato_soup_can", "A can of soup.", 349.0, _standing(66.0, 101.0), _TIN, (0.80, 0.10, 0.10), YCB_TABLE),
    _object("tuna_fish_can", "A can of tuna.", 171.0, _standing(85.0, 33.0), _TIN, (0.20, 0.40, 0.65), YCB_TABLE),
    _object("potted_meat_can", "A can of meat.", 370.0, _box(97.0, 50.0, 82.0), _TIN, (0.15, 0.30, 0.60), YCB_TABLE),
    _object("foam_brick", "A brick of foam.", 28.0, _box(75.0, 50.0, 50.0), _FOAM, (0.70, 0.25, 0.15), YCB_TABLE),
    Body(
        "mustard_bottle",
        f"A bottle of mustard, its neck as wide as a third of it. Source: {YCB_TABLE}.",
        0.603,
        (
            Part("box", (0.095, 0.058, 0.150), (0.0, 0.0, -0.020)),
            Part("cylinder", (0.016, 0.042), (0.0, 0.0, 0.074)),
        ),
        _PLASTIC,
        colour=(0.95, 0.80, 0.10),
    ),
)

HOUSEHOLD = (*_FROM_GRASP_TABLE, *_FROM_YCB_TABLE)
