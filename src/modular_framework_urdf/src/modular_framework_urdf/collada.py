# SPDX-License-Identifier: BSD-3-Clause
"""Reads from a COLLADA file what a mesh reader does not check: the length of its unit, and its number of triangles."""

from __future__ import annotations

from modular_framework_urdf import xml_text
from modular_framework_urdf.xml_text import Element

_MOST_NODES = 100_000
_MATERIAL_LIBRARIES = ("library_images", "library_effects", "library_materials")


def parse(content: bytes, where: str) -> Element:
    """Returns the root of a COLLADA file; the tags lose their namespace.

    Raises:
        ValueError: it is no XML, has a DOCTYPE, or is something else than COLLADA.
    """
    root = xml_text.parse(content, where)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    if root.tag != "COLLADA":
        raise ValueError(f"its root element is <{root.tag}>, not <COLLADA>")
    return root


def unit(root: Element) -> float:
    """Returns the length of the file's unit [m]; raises ValueError where it is none."""
    element = root.find("asset/unit")
    metres = float("1" if element is None else element.get("meter", "1"))
    if not 0.0 < metres < float("inf"):
        raise ValueError(f"its <unit> is {metres} m long; a length above 0 is needed")
    return metres


def without_materials(root: Element) -> bytes:
    """Returns the file without materials, because a reader drops a part whose texture is missing."""
    for parent in list(root.iter()):
        for child in [one for one in parent if one.tag == "bind_material" or one.tag in _MATERIAL_LIBRARIES]:
            parent.remove(child)
    return to_bytes(root)


def to_bytes(root: Element) -> bytes:
    """Returns a parsed file as COLLADA again."""
    root.set("xmlns", "http://www.collada.org/2005/11/COLLADASchema")
    return xml_text.to_text(root).encode()


def triangles(root: Element) -> int:
    """Counts the triangles of every instance that the scene shows."""
    known = {element.get("id"): element for element in root.iter() if element.get("id")}
    # Some exporters call the scene and a node in it by the same id.
    scenes = {element.get("id"): element for element in root.iter("visual_scene")}
    shown = root.find("scene/instance_visual_scene")
    nodes = [] if shown is None else list(scenes[shown.get("url", "")[1:]].findall("node"))
    geometries: dict[str, int] = {}
    triangles = visited = 0
    while nodes:
        node = nodes.pop()
        visited += 1
        if visited > _MOST_NODES:
            raise ValueError(f"its scene has more than {_MOST_NODES} nodes")
        nodes += node.findall("node") + [known[one.get("url", "")[1:]] for one in node.findall("instance_node")]
        for instance in (*node.findall("instance_geometry"), *node.findall("instance_controller")):
            name = instance.get("url", "")[1:]
            if name not in geometries:
                geometries[name] = _geometry(_mesh_of(known, name))
            triangles += geometries[name]
    return triangles


def _mesh_of(known: dict[str | None, Element], name: str) -> Element:
    """Returns the geometry a name stands for; that of a controller is the one it deforms."""
    element = known[name]
    while element.tag == "controller":
        inner = element.find("skin") if element.find("skin") is not None else element.find("morph")
        if inner is None:
            raise ValueError(f"controller '{name}' names no geometry")
        element = known[inner.get("source", "")[1:]]
    return element


def _geometry(geometry: Element) -> int:
    triangles = 0
    for kind in ("triangles", "tristrips", "trifans", "polylist", "polygons"):
        for primitive in geometry.findall(f"mesh/{kind}"):
            stride = 1 + max((int(one.get("offset", "0")) for one in primitive.findall("input")), default=0)
            corners = [len((one.text or "").split()) // stride for one in primitive.findall(".//p")]
            if kind == "triangles":
                triangles += sum(corners) // 3
            elif kind == "polylist":
                triangles += sum(int(one) - 2 for one in primitive.findtext("vcount", "").split())
            else:
                triangles += sum(one - 2 for one in corners)
    return triangles


def keep_part(root: Element, name: str) -> list[str]:
    """Takes out what does not belong to the node of a name; returns the names of all nodes that have a body.

    A body belongs to the nearest node around it that has a name.
    """
    names: dict[str, None] = {}
    for node in list(root.iter("node")):
        bodies = [*node.findall("instance_geometry"), *node.findall("instance_controller")]
        if not bodies:
            continue
        named = [each for each in (node, *node.iterancestors("node")) if each.get("name")]
        own = named[0].get("name") if named else ""
        names[own] = None
        for body in bodies if own != name else ():
            node.remove(body)
    return [each for each in names if each]
