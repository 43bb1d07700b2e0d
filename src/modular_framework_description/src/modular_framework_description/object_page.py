# SPDX-License-Identifier: BSD-3-Clause
"""Writes the check page of an object: pictures, size, mass, inertia, stable poses and warnings, without other files."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable

from modular_framework_description.object_drawings import FRONT, SIDE, TOP, drawing, sharp_edges
from modular_framework_description.object_record import ObjectRecord

PICTURE_PX, POSE_PX, PICTURED_POSES, MAX_ROWS = 260.0, 110.0, 6, 24

STYLE = """body{font:15px/1.5 sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222;background:#fff}
figure{display:inline-block;margin:0 1.5rem 1rem 0;vertical-align:bottom}figcaption{font-size:13px;color:#555}
table{border-collapse:collapse;margin:.5rem 0 1.5rem}td,th{padding:.2rem .8rem .2rem 0;text-align:left;
border-bottom:1px solid #ddd}td.n{text-align:right;font-variant-numeric:tabular-nums}
.w{background:#fff3cd;border-left:4px solid #e0a800;padding:.4rem .8rem;margin:.4rem 0}
.ok{background:#e3f4e5;border-left:4px solid #3a9d4a;padding:.4rem .8rem}code{background:#f3f3f3;padding:0 .2rem}"""


def check_page(record: ObjectRecord, use: str) -> str:
    """Returns the check page of an object.

    Args:
        record: Object with its properties.
        use: Lines that select the object in an experiment.
    """
    name = html.escape(record.name)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{name}</title><style>{STYLE}</style></head><body>
<h1>{name}</h1>
{_warnings(record)}
<h2>Shape</h2>
{_pictures(record)}
<p>Colours distinguish the {len(record.parts)} convex parts that the physics and the planner use; lines are sharp edges
of the mesh. The origin of the object frame is the centre of the bounding box.</p>
<h2>Properties</h2>
{_table(_properties(record))}
<h2>Stable poses</h2>
{_poses(record)}
<h2>Grippers</h2>
{_grippers(record)}
<h2>Use</h2>
<pre>{html.escape(use)}</pre>
</body></html>
"""


def _warnings(record: ObjectRecord) -> str:
    if not record.warnings:
        return '<p class="ok">No warnings.</p>'
    return "".join(f'<p class="w">{html.escape(text)}</p>' for text in record.warnings)


def _pictures(record: ObjectRecord) -> str:
    scale = PICTURE_PX / max(record.item.sides)
    edges = sharp_edges(record.item.mesh)
    x, y, z = (f"{side * 1e3:.1f}" for side in record.item.sides)
    views = (
        (FRONT, f"front, seen along +y: x right, z up; {x} x {z} mm"),
        (SIDE, f"side, seen along -x: y right, z up; {y} x {z} mm"),
        (TOP, f"top, seen along -z: x right, y up; {x} x {y} mm"),
    )
    return "".join(_figure(drawing(record.parts, edges, view, scale), caption) for view, caption in views)


def _figure(picture: str, caption: str) -> str:
    return f"<figure>{picture}<figcaption>{html.escape(caption)}</figcaption></figure>"


def _properties(record: ObjectRecord) -> Iterable[tuple[str, str]]:
    item, properties = record.item, record.solid.properties
    state = "no" if not item.is_closed else "after a repair" if item.repaired else "yes"
    yield "mesh", f"{record.source}, scale {record.scale:g}, {len(item.mesh.triangles)} triangles, watertight: {state}"
    yield "size x, y, z [m]", _numbers(item.sides, ".4f")
    yield "narrowest side, in any orientation [m]", f"{item.narrowest_m:.4f}"
    yield "volume [m^3]", f"{record.solid.volume:.4g}"
    yield "mass [kg]", f"{properties.mass:.4g} (density {properties.mass / record.solid.volume:.4g} kg/m^3)"
    yield "centre of mass [m]", _numbers(properties.centre, ".4f")
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = properties.inertia
    yield "inertia xx, yy, zz [kg m^2]", _numbers((xx, yy, zz), ".4g")
    yield "inertia xy, xz, yz [kg m^2]", _numbers((xy, xz, yz), ".4g")
    yield "friction coefficient", f"{record.friction:g}"


def _numbers(values: Iterable[float], style: str) -> str:
    return ", ".join(format(float(value) + 0.0, style) for value in values)


def _table(rows: Iterable[tuple[str, str]]) -> str:
    lines = "".join(f"<tr><th>{html.escape(key)}</th><td>{html.escape(value)}</td></tr>" for key, value in rows)
    return f"<table>{lines}</table>"


def _poses(record: ObjectRecord) -> str:
    scale, edges = POSE_PX / max(record.item.sides), sharp_edges(record.item.mesh)
    shown = record.poses[:MAX_ROWS]
    pictures = "".join(
        _figure(
            drawing(record.parts, edges, FRONT @ pose.rotation, scale, ground=True),
            f"{index}: {100 * pose.probability:.1f} %",
        )
        for index, pose in enumerate(shown[:PICTURED_POSES], 1)
    )
    rows = "".join(
        f'<tr><td class="n">{index}</td><td class="n">{100 * pose.probability:.1f} %</td>'
        f'<td class="n">{pose.roll:.4f}</td><td class="n">{pose.pitch:.4f}</td>'
        f'<td class="n">{pose.height:.4f}</td></tr>'
        for index, pose in enumerate(shown, 1)
    )
    rest = len(record.poses) - len(shown)
    share = 1.0 - math.fsum(pose.probability for pose in shown)
    more = f"<p>{rest} further poses have a total probability of {100 * share:.1f} %.</p>" if rest else ""
    head = "<tr><th></th><th>probability</th><th>roll [rad]</th><th>pitch [rad]</th><th>height [m]</th></tr>"
    return f"{pictures}<table>{head}{rows}</table>{more}"


def _grippers(record: ObjectRecord) -> str:
    if not record.grippers:
        return "<p>No two-finger gripper of an installed robot was found.</p>"
    return _table(
        (gripper.name, f"opens from {gripper.least_m:.3f} to {gripper.greatest_m:.3f} m") for gripper in record.grippers
    )
