# SPDX-License-Identifier: BSD-3-Clause
"""Reads the unit and the number of triangles of a COLLADA file, which mesh readers do not check."""

from __future__ import annotations

from modular_framework_urdf import xml_text
from modular_framework_urdf.xml_text import Element

_MAX_NODES = 100_000
_MATERIAL_LIBRARIES = ("library_images", "library_effects", "library_materials")


def parse(content: bytes, location: str) -> Element:
    """Returns the root element of a COLLADA file with tags without namespace.

    Raises:
        ValueError: The content is not XML, has a DOCTYPE, or is not COLLADA.
    """
    root = xml_text.parse(content, location)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    if root.tag != "COLLADA":
        raise ValueError(f"its root element is <{root.tag}>, not <COLLADA>")
    return root


def unit(root: Element) -> float:
    """Returns the length of the file's unit [m]; raises ValueError for an invalid unit."""
    element = root.find("asset/unit")
    metres = float("1" if element is None else element.get("meter", "1"))
    if not 0.0 < metres < float("inf"):
        raise ValueError(f"its <unit> is {metres} m long; it must be above 0")
    return metres


def without_materials(root: Element) -> bytes:
    """Returns the file without materials, because trimesh drops parts with missing textures."""
    for parent in list(root.iter()):
        for child in [item for item in parent if item.tag == "bind_material" or item.tag in _MATERIAL_LIBRARIES]:
            parent.remove(child)
    return to_bytes(root)


def to_bytes(root: Element) -> bytes:
    """Returns a parsed file as COLLADA text."""
    root.set("xmlns", "http://www.collada.org/2005/11/COLLADASchema")
    return xml_text.to_text(root).encode()


def triangles(root: Element) -> int:
    """Counts the triangles of all instances in the scene."""
    known = {element.get("id"): element for element in root.iter() if element.get("id")}
    # Some exporters give the scene and one of its nodes the same ID.
    scenes = {element.get("id"): element for element in root.iter("visual_scene")}
    scene = root.find("scene/instance_visual_scene")
    nodes = [] if scene is None else list(scenes[scene.get("url", "")[1:]].findall("node"))
    geometries: dict[str, int] = {}
    triangles = visited = 0
    while nodes:
        node = nodes.pop()
        visited += 1
        if visited > _MAX_NODES:
            raise ValueError(f"its scene has more than {_MAX_NODES} nodes")
        nodes += node.findall("node") + [known[item.get("url", "")[1:]] for item in node.findall("instance_node")]
        for instance in (*node.findall("instance_geometry"), *node.findall("instance_controller")):
            name = instance.get("url", "")[1:]
            if name not in geometries:
                geometries[name] = _geometry_triangles(_mesh_of(known, name))
            triangles += geometries[name]
    return triangles


def _mesh_of(known: dict[str | None, Element], name: str) -> Element:
    """Returns the geometry of a name; a controller refers to the geometry that it deforms."""
    element = known[name]
    while element.tag == "controller":
        deformer = element.find("skin") if element.find("skin") is not None else element.find("morph")
        if deformer is None:
            raise ValueError(f"controller '{name}' names no geometry")
        element = known[deformer.get("source", "")[1:]]
    return element


def _geometry_triangles(geometry: Element) -> int:
    triangles = 0
    for kind in ("triangles", "tristrips", "trifans", "polylist", "polygons"):
        for primitive in geometry.findall(f"mesh/{kind}"):
            stride = 1 + max((int(item.get("offset", "0")) for item in primitive.findall("input")), default=0)
            corners = [len((item.text or "").split()) // stride for item in primitive.findall(".//p")]
            if kind == "triangles":
                triangles += sum(corners) // 3
            elif kind == "polylist":
                triangles += sum(int(count) - 2 for count in primitive.findtext("vcount", "").split())
            else:
                triangles += sum(count - 2 for count in corners)
    return triangles


def keep_part(root: Element, name: str) -> list[str]:
    """Removes all geometry that does not belong to a named node; returns the names of all nodes with geometry.

    Geometry belongs to the closest enclosing node with a name.
    """
    names: dict[str, None] = {}
    for node in list(root.iter("node")):
        instances = [*node.findall("instance_geometry"), *node.findall("instance_controller")]
        if not instances:
            continue
        named = [item for item in (node, *node.iterancestors("node")) if item.get("name")]
        owner = named[0].get("name") if named else ""
        names[owner] = None
        for instance in instances if owner != name else ():
            node.remove(instance)
    return [item for item in names if item]
