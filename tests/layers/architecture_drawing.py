# SPDX-License-Identifier: BSD-3-Clause
"""Draws packages, the rooms inside them and who imports whom.

An arrow that follows from others is left out. The drawing carries a digest of what it was drawn from: a test compares
that instead of drawing it again, because another version of dot may place the boxes differently.
"""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from layer_checks import room_of
from layer_table import LayerTable
from source_tree import SourceTree, leads_to, package_of

Edges = set[tuple[str, str]]

_HEADER = """digraph architecture {
  compound=true; rankdir=TB; newrank=true; nodesep=0.25; ranksep=0.4; fontname="Helvetica"; fontsize=15;
  node [shape=box, style="rounded,filled", fillcolor="#ffffff", color="#5b6b7b", fontname="Helvetica", fontsize=13,
        height=0.3, margin="0.12,0.05"];
  edge [color="#5b6b7b", arrowsize=0.7];"""
_CLUSTER = 'style="rounded,filled"; color="#5b6b7b"; fillcolor="#eef3f8"; margin=12;'
_PACKAGE_NODE = 'fillcolor="#eef3f8", fontsize=15'
_FORWARDING_NODE = 'fillcolor="#f4f4f4", style="rounded,filled,dashed"'
_BETWEEN_PACKAGES = 'penwidth=1.8, color="#20405f"'
_EXEMPT = 'style=dashed, color="#b03020", constraint=false'


def dot_text(tree: SourceTree, table: LayerTable) -> str:
    """Writes the drawing in the language of Graphviz's dot."""
    imports = tree.internal_imports()
    exempt = {(each.importer, each.imported) for each in imports if any(it.covers(each) for it in table.exemptions)}
    pairs = {(each.importer, each.imported) for each in imports} - exempt
    lines = [_HEADER]
    connected = {package_of(module) for pair in pairs | exempt for module in pair}
    for package in sorted(connected):
        lines += _package_lines(package, tree, table, pairs)
    for upper, lower in sorted(without_shortcuts(between(pairs, package_of))):
        lines.append(f"  {_arrow(upper, lower, table, _BETWEEN_PACKAGES)}")
    for upper, lower in sorted(between(exempt, package_of)):
        lines.append(f"  {_arrow(upper, lower, table, _EXEMPT)}")
    return "\n".join([*lines, "}", ""])


def between(pairs: Iterable[tuple[str, str]], group: Callable[[str], str]) -> Edges:
    """Returns which groups import which, given which modules do."""
    edges = {(group(importer), group(imported)) for importer, imported in pairs}
    return {(importer, imported) for importer, imported in edges if importer != imported}


def without_shortcuts(edges: Edges) -> Edges:
    """Leaves out every edge that another way leads around (the transitive reduction)."""
    return {(start, end) for start, end in edges if not leads_to(start, end, edges - {(start, end)})}


def _package_lines(package: str, tree: SourceTree, table: LayerTable, pairs: Edges) -> Iterator[str]:
    rooms = [room for level in table.levels(package) for room in level]
    if not rooms:
        style = _FORWARDING_NODE if tree.folders[package].startswith("compat/") else _PACKAGE_NODE
        yield f'  "{package}" [{style}];'
        return
    yield f'  subgraph "cluster_{package}" {{ label="{package}"; {_CLUSTER}'
    for room in rooms:
        yield f'    "{package}/{room}" [label="{_room_label(package, room, tree)}"];'
    inside = between(pairs, lambda module: room_of(module, package, tree))
    arrows = without_shortcuts({edge for edge in inside if all(edge)})
    for upper, lower in sorted(arrows):
        yield f'    "{package}/{upper}" -> "{package}/{lower}";'
    for room in rooms:
        if len(rooms) > 1 and not any(room in arrow for arrow in arrows):  # an unseen arrow keeps it near the others
            upper, lower = (rooms[1], room) if room == rooms[0] else (room, rooms[0])
            yield f'    "{package}/{upper}" -> "{package}/{lower}" [style=invis];'
    yield "  }"


def _room_label(package: str, room: str, tree: SourceTree) -> str:
    """Returns the name of a room, or the modules that lie directly in the package, a few of them by name."""
    if room != ".":
        return room
    names = sorted(name.rpartition(".")[2] for name in tree.files if room_of(name, package, tree) == ".")
    return ", ".join(names) if len(names) <= 3 else f"{len(names)} modules"


def _arrow(upper: str, lower: str, table: LayerTable, style: str) -> str:
    """Writes an arrow between two packages: it starts and ends at the frame of one that has rooms."""
    ends = [f'"{upper}"', f'"{lower}"']
    if upper in table.rooms:
        ends[0] = f'"{upper}/{table.levels(upper)[0][0]}"'
        style += f', ltail="cluster_{upper}"'
    if lower in table.rooms:
        ends[1] = f'"{lower}/{table.levels(lower)[-1][0]}"'
        style += f', lhead="cluster_{lower}"'
    return f"{' -> '.join(ends)} [{style}];"


def draw(text: str, path: Path) -> None:
    """Draws with Graphviz's dot, and writes the digest of the text into the SVG.

    Raises:
        subprocess.CalledProcessError: dot cannot draw it.
    """
    svg = subprocess.run(["dot", "-Tsvg"], input=text, capture_output=True, text=True, check=True).stdout
    path.write_text(f"{svg}<!-- {_digest(text)} -->\n")


def is_up_to_date(text: str, path: Path) -> bool:
    """Returns whether a drawing was made from this text."""
    return path.is_file() and path.read_text().rstrip().endswith(f"<!-- {_digest(text)} -->")


def _digest(text: str) -> str:
    return f"drawn from imports {hashlib.sha256(text.encode()).hexdigest()}"
