# SPDX-License-Identifier: BSD-3-Clause
"""The models of this package, by their shapes: what ``scripts/generate_models`` writes into ``models/``.

The frame of every graspable model is at the middle of its bounding box, so it stands on a surface of height h when
placed at h + height / 2. The frame of furniture is on the floor.
"""

from modular_framework_description.solids import Body, Part, ring_of_boxes

_TABLE_HEIGHT = 0.84
_TABLE_TOP = 0.03

_SHELF_WIDTH, _SHELF_DEPTH, _BOARD = 0.90, 0.35, 0.02
_SHELF_TOPS = (0.40, _TABLE_HEIGHT, 1.40)
_BIN, _BIN_WALL = (0.40, 0.30, 0.12), 0.01

_BRACKET = (
    Part("box", (0.08, 0.03, 0.02), (0.0, 0.0, -0.03)),
    Part("box", (0.02, 0.03, 0.06), (-0.03, 0.0, 0.01)),
)
_MUG_RADIUS = 0.036
_MUG = (
    *ring_of_boxes(_MUG_RADIUS, 0.005, 0.09, 16, 0.0),
    Part("cylinder", (_MUG_RADIUS - 0.002, 0.006), (0.0, 0.0, -0.041)),
    Part("box", (0.028, 0.010, 0.010), (0.049, 0.0, 0.025)),
    Part("box", (0.028, 0.010, 0.010), (0.049, 0.0, -0.025)),
    Part("box", (0.008, 0.010, 0.060), (0.061, 0.0, 0.0)),
)

GRASPABLE = (
    Body(
        "cube",
        "A wooden cube with edges of 50 mm.",
        0.10,
        (Part("box", (0.05, 0.05, 0.05)),),
        colour=(0.85, 0.55, 0.20),
    ),
    Body(
        "wood_block",
        "An upright wooden block, 50 mm square and 100 mm high.",
        0.18,
        (Part("box", (0.05, 0.05, 0.10)),),
        colour=(0.70, 0.45, 0.22),
    ),
    Body(
        "tea_box",
        "A carton of 40 x 70 x 120 mm.",
        0.15,
        (Part("box", (0.04, 0.07, 0.12)),),
        friction=0.7,
        colour=(0.20, 0.55, 0.30),
    ),
    Body(
        "can",
        "A full can, 66 mm in diameter and 115 mm high.",
        0.35,
        (Part("cylinder", (0.033, 0.115)),),
        friction=0.7,
        colour=(0.75, 0.12, 0.12),
    ),
    Body(
        "tube",
        "An upright tube, 40 mm in diameter and 140 mm high.",
        0.12,
        (Part("cylinder", (0.02, 0.14)),),
        colour=(0.15, 0.35, 0.75),
    ),
    Body(
        "ball",
        "A rubber ball of 64 mm.",
        0.08,
        (Part("sphere", (0.032,)),),
        friction=1.0,
        rolling_friction=0.001,
        colour=(0.90, 0.85, 0.15),
    ),
    Body(
        "l_bracket",
        "An L-shaped bracket, 30 mm wide: not convex.",
        0.14,
        _BRACKET,
        colour=(0.55, 0.57, 0.60),
        mesh_name="l_bracket.stl",
    ),
    Body(
        "mug",
        "A hollow mug of 72 mm with a handle: not convex.",
        0.25,
        _MUG,
        colour=(0.90, 0.90, 0.88),
        mesh_name="mug.stl",
    ),
)

FURNITURE = (
    Body(
        "table",
        "A table of 1.2 x 0.8 m; its surface is 0.84 m above the floor.",
        0.0,
        (
            Part("box", (1.2, 0.8, _TABLE_TOP), (0.0, 0.0, _TABLE_HEIGHT - _TABLE_TOP / 2.0)),
            *(
                Part("box", (0.05, 0.05, _TABLE_HEIGHT - _TABLE_TOP), (x, y, (_TABLE_HEIGHT - _TABLE_TOP) / 2.0))
                for x in (-0.56, 0.56)
                for y in (-0.36, 0.36)
            ),
        ),
        colour=(0.80, 0.74, 0.64),
    ),
    Body(
        "shelf",
        "A shelf of 0.9 x 0.35 m with boards whose tops are 0.40, 0.84 and 1.40 m above the floor; open in front (-y).",
        0.0,
        (
            *(Part("box", (_SHELF_WIDTH, _SHELF_DEPTH, _BOARD), (0.0, 0.0, top - _BOARD / 2.0)) for top in _SHELF_TOPS),
            *(
                Part("box", (_BOARD, _SHELF_DEPTH, _SHELF_TOPS[-1]), (x, 0.0, _SHELF_TOPS[-1] / 2.0))
                for x in (-(_SHELF_WIDTH + _BOARD) / 2.0, (_SHELF_WIDTH + _BOARD) / 2.0)
            ),
            Part(
                "box",
                (_SHELF_WIDTH, _BOARD, _SHELF_TOPS[-1]),
                (0.0, (_SHELF_DEPTH + _BOARD) / 2.0, _SHELF_TOPS[-1] / 2.0),
            ),
        ),
        colour=(0.85, 0.82, 0.75),
    ),
    Body(
        "bin",
        "An open bin, 0.40 x 0.30 m and 0.12 m high inside; its walls are 10 mm thick. Its frame is under its floor.",
        0.0,
        (
            Part("box", (_BIN[0] + 2.0 * _BIN_WALL, _BIN[1] + 2.0 * _BIN_WALL, _BIN_WALL), (0.0, 0.0, _BIN_WALL / 2.0)),
            *(
                Part("box", (_BIN_WALL, _BIN[1], _BIN[2]), (x, 0.0, _BIN_WALL + _BIN[2] / 2.0))
                for x in (-(_BIN[0] + _BIN_WALL) / 2.0, (_BIN[0] + _BIN_WALL) / 2.0)
            ),
            *(
                Part("box", (_BIN[0] + 2.0 * _BIN_WALL, _BIN_WALL, _BIN[2]), (0.0, y, _BIN_WALL + _BIN[2] / 2.0))
                for y in (-(_BIN[1] + _BIN_WALL) / 2.0, (_BIN[1] + _BIN_WALL) / 2.0)
            ),
        ),
        colour=(0.25, 0.35, 0.55),
    ),
    Body(
        "robot_pedestal",
        "The stand of the arm, 0.85 m high: its top stays 7 mm clear of the arm's base.",
        0.0,
        (Part("box", (0.24, 0.24, 0.85), (0.0, 0.0, 0.425)),),
        colour=(0.30, 0.31, 0.33),
    ),
)
