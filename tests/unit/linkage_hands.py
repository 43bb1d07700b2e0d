# SPDX-License-Identifier: BSD-3-Clause
"""Hands with four-bar fingers for tests, made of boxes: their joints are those that Robotiq published for the 2F-85."""

from __future__ import annotations


def link(name: str, *box: float, z: float = 0.0) -> str:
    size = " ".join(map(str, box))
    shape = f'<collision><origin xyz="0 0 {z}"/><geometry><box size="{size}"/></geometry></collision>' if box else ""
    return f'<link name="{name}">{shape}</link>'


def joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str = "1 0 0", rest: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{rest}</joint>'
    )


def limit(upper: float, effort: float = 10.0) -> str:
    return f'<limit lower="0" upper="{upper}" effort="{effort}" velocity="2"/>'


def mimic(of: str, multiplier: float, upper: float = 0.8, lower: float | None = None, effort: float = 10.0) -> str:
    tag = f'<mimic joint="{of}" multiplier="{multiplier}"/>'
    lower = -upper if lower is None else lower
    return f'<limit lower="{lower}" upper="{upper}" effort="{effort}" velocity="2"/>{tag}'


def four_bar_parts(lower: float | None = None, effort: float = 10.0, inner_knuckle: float = 0.04) -> str:
    """Links and joints of a hand: knuckles that turn, and fingers that stay upright.

    Args:
        lower: Lower limit of the mimic joints [rad]; -0.8 by default.
        effort: Effort limit of all joints [N m].
        inner_knuckle: Height of the bars nearest to the middle [m]; straight ones of 0.04 m meet before the pads do.
    """
    parts = [link("palm", 0.08, 0.08, 0.09, z=0.045)]
    for side, name in ((1, "left"), (-1, "right")):
        follow = [mimic("drive", multiplier, lower=lower, effort=effort) for multiplier in (1.0, -1.0)]
        drive = limit(0.8, effort) if side > 0 else follow[0]
        lead = "drive" if side > 0 else "right_drive"
        parts += [
            link(f"{name}_knuckle", 0.02, 0.01, 0.01),
            joint(lead, "revolute", "palm", f"{name}_knuckle", f"0 {side * 0.0306} 0.0549", f"{side} 0 0", drive),
            link(f"{name}_finger", 0.02, 0.01, 0.04, z=0.02),
            joint(f"{name}_f", "fixed", f"{name}_knuckle", f"{name}_finger", f"0 {side * 0.0315} -0.0041"),
            link(f"{name}_inner_finger", 0.02, 0.01, 0.04, z=0.02),
            joint(f"{name}_i", "revolute", f"{name}_finger", f"{name}_inner_finger", f"0 {side * 0.0061} 0.0471",
                  f"{side} 0 0", follow[1]),
            link(f"{name}_pad", 0.022, 0.00635, 0.0375),
            joint(f"{name}_p", "fixed", f"{name}_inner_finger", f"{name}_pad", f"0 {side * -0.0220} 0.0324"),
            link(f"{name}_inner_knuckle", 0.02, 0.01, inner_knuckle, z=inner_knuckle / 2),
            joint(f"{name}_k", "revolute", "palm", f"{name}_inner_knuckle", f"0 {side * 0.0127} 0.0614",
                  f"{side} 0 0", follow[0]),
        ]  # fmt: skip
    return "".join(parts)


def four_bar_hand() -> str:
    return f'<robot name="four_bar">{four_bar_parts()}</robot>'
