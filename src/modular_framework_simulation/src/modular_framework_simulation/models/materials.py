# SPDX-License-Identifier: BSD-3-Clause
"""Finds the colour and texture of a named material."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.sdf_specs import GREY, Colour
from modular_framework_simulation.models.xml_nodes import XmlNode

GAZEBO_PREFIX = "Gazebo/"

_GAZEBO_RGB: dict[str, tuple[float, float, float]] = {
    "Grey": (0.7, 0.7, 0.7),
    "Gray": (0.7, 0.7, 0.7),
    "DarkGrey": (0.175, 0.175, 0.175),
    "DarkGray": (0.175, 0.175, 0.175),
    "White": (1, 1, 1),
    "FlatBlack": (0.1, 0.1, 0.1),
    "Black": (0, 0, 0),
    "Red": (1, 0, 0),
    "RedBright": (0.87, 0.26, 0.07),
    "Green": (0, 1, 0),
    "Blue": (0, 0, 1),
    "SkyBlue": (0.13, 0.44, 0.70),
    "Yellow": (1, 1, 0),
    "ZincYellow": (0.9725, 0.9529, 0.2078),
    "DarkYellow": (0.7, 0.7, 0),
    "Purple": (1, 0, 1),
    "Turquoise": (0, 1, 1),
    "Orange": (1, 0.5088, 0.0468),
    "Indigo": (0.33, 0, 0.5),
    "Gold": (0.8, 0.64869, 0.120759),
    "Pioneer2Body": (0.681193, 0.000923, 0.000923),
    "PioneerBody": (1, 0, 0),
    "LightOn": (0, 1, 0),
    "LightOff": (1, 0, 0),
    "JointAnchor": (1, 1, 1),
}
"""Diffuse colours of Gazebo's materials."""

_GAZEBO_TEXTURES_RGB: dict[str, tuple[float, float, float]] = {
    "Wood": (0.6, 0.43, 0.26),
    "WoodFloor": (0.55, 0.38, 0.22),
    "WoodPallet": (0.66, 0.53, 0.36),
    "Bricks": (0.6, 0.33, 0.25),
    "PaintedWall": (0.85, 0.83, 0.78),
    "CeilingTiled": (0.85, 0.85, 0.85),
    "WindowFrame": (0.8, 0.8, 0.8),
    "Road": (0.3, 0.3, 0.3),
    "Residential": (0.3, 0.3, 0.3),
    "Tertiary": (0.3, 0.3, 0.3),
    "Pedestrian": (0.6, 0.6, 0.6),
    "Footway": (0.6, 0.6, 0.6),
    "Motorway": (0.25, 0.25, 0.25),
    "Trunk": (0.25, 0.25, 0.25),
    "Primary": (0.25, 0.25, 0.25),
    "Secondary": (0.25, 0.25, 0.25),
    "Lane_1": (0.25, 0.25, 0.25),
    "Lanes_2": (0.25, 0.25, 0.25),
    "Lanes_4": (0.25, 0.25, 0.25),
    "Lanes_6": (0.25, 0.25, 0.25),
    "CloudySky": (0.7, 0.8, 0.95),
    "GreyGradientSky": (0.75, 0.75, 0.75),
    "Grass": (0.3, 0.5, 0.2),
}
"""Plain colours that replace the textures of Gazebo's materials, chosen by eye."""

_GLOW, _TRANSPARENT = re.compile("Glow(Outline)?$"), re.compile("(Transparent(Overlay)?|Laser)$")
_TRANSPARENT_ALPHA = 0.5


@dataclass(frozen=True, slots=True)
class Material:
    """Appearance of a surface.

    Attributes:
        colour: Diffuse colour.
        texture: Image file of the texture; None for a plain colour.
        missing_texture: Name of a missing image file; empty if no file is missing.
    """

    colour: Colour = GREY
    texture: Path | None = None
    missing_texture: str = ""


def gazebo_material(name: str) -> Material | None:
    """Returns a Gazebo material by name, with or without the prefix "Gazebo/"; None if the name is unknown."""
    short = name.removeprefix(GAZEBO_PREFIX)
    alpha = _TRANSPARENT_ALPHA if _TRANSPARENT.search(short) else 1.0
    plain = _TRANSPARENT.sub("", _GLOW.sub("", short))
    rgb = _GAZEBO_RGB.get(plain) or _GAZEBO_TEXTURES_RGB.get(plain)
    return Material((*rgb, alpha)) if rgb is not None else None


def script_material(script: XmlNode, resources: Resources) -> Material:
    """Returns the material of a <script>.

    Args:
        script: Element with a <name> and with <uri> elements of files or folders.
        resources: Folders and packages for the URIs.

    Raises:
        DescriptionError: The material is unknown.
    """
    name_node = script.find("name")
    name = name_node.text.strip() if name_node is not None else script.text.strip()
    folders: list[Path] = []
    for uri in script.find_all("uri"):
        try:
            folders.append(resources.resolve(uri, uri.text.strip()))
        except DescriptionError:  # Gazebo's own files are rarely installed; the name may be known without the files
            continue
    for folder in folders:
        material = _in_scripts(folder, name, folders)
        if material is not None:
            return material
    known = gazebo_material(name) if name.startswith(GAZEBO_PREFIX) else None
    if known is None:
        looked = ", ".join(str(folder) for folder in folders) or "no existing file"
        raise DescriptionError(script.location, f"material '{name}' is not found", f"looked in {looked}")
    return known


def _in_scripts(folder: Path, name: str, folders: list[Path]) -> Material | None:
    files = sorted(folder.glob("*.material")) if folder.is_dir() else [folder]
    for file in files:
        if file.suffix != ".material":
            continue
        try:
            entries = parse_material_script(file.read_text(encoding="utf-8", errors="replace"))
        except OSError:
            continue
        if name in entries:
            colour, image = entries[name]
            texture = _find_image(image, [*folders, file.parent, file.parent.parent / "textures"])
            return Material(colour, texture, image if texture is None else "")
    return None


def _find_image(image: str, folders: list[Path]) -> Path | None:
    if not image:
        return None
    return next((folder / image for folder in folders if (folder / image).is_file()), None)


_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_TOKEN = re.compile(r"[{}]|[^{}\n]+")


def parse_material_script(text: str) -> dict[str, tuple[Colour, str]]:
    """Parses a material script of the Ogre engine.

    A material may inherit from a previous material (`material Child : Parent`). The default colour is white with a
    texture and grey without a texture.

    Returns:
        Colour and texture file ("" for none), by name of the material.
    """
    materials: dict[str, tuple[Colour | None, str]] = {}
    name, depth = "", 0
    for token in _TOKEN.findall(_COMMENT.sub(" ", text)):
        words = token.split()
        match words:
            case []:
                continue
            case ["{"]:
                depth += 1
            case ["}"]:
                depth -= 1
            case ["material", *named] if depth == 0:
                own, _, parent = " ".join(named).partition(":")
                name = own.strip().strip('"')
                if name:
                    materials[name] = materials.get(parent.strip().strip('"'), (None, ""))
            case ["diffuse", *numbers] if name and depth > 0:
                materials[name] = (_colour(numbers) or materials[name][0], materials[name][1])
            case ["ambient", *numbers] if name and depth > 0 and materials[name][0] is None:
                materials[name] = (_colour(numbers), materials[name][1])
            case ["texture", image, *_] if name and depth > 0 and not materials[name][1]:
                materials[name] = (materials[name][0], image.strip('"'))
    white: Colour = (1.0, 1.0, 1.0, 1.0)
    return {key: (colour or (white if image else GREY), image) for key, (colour, image) in materials.items()}


def _colour(words: list[str]) -> Colour | None:
    try:
        numbers = [float(word) for word in words[:4]]
    except ValueError:
        return None
    if len(numbers) < 3:
        return None
    return (numbers[0], numbers[1], numbers[2], numbers[3] if len(numbers) > 3 else 1.0)
