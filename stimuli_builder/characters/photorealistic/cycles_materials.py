"""Skin, eye, tears and hair as shader nodes. Runs in Blender's own Python: see cycles_worker.py."""

from pathlib import Path
from typing import Any

import bpy

Settings = dict[str, Any]


class Nodes:
    """A material's node tree, with the few words needed to wire it."""

    def __init__(self, name: str) -> None:
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        self.output = self.add("OutputMaterial")

    def add(self, kind: str, **settings: Any) -> Any:
        """Add a shader node; settings are its attributes or, with _ for spaces, its inputs."""
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for key, value in settings.items():
            if hasattr(node, key):
                setattr(node, key, value)
            else:
                node.inputs[key.replace("_", " ")].default_value = value
        return node

    def link(self, source: Any, target: Any) -> None:
        """Wire an output to an input."""
        self.tree.links.new(source, target)

    def surface(self, node: Any) -> Any:
        """Make a shader the material's surface and return the material."""
        self.link(node.outputs[0], self.output.inputs["Surface"])
        return self.material

    def attribute(self, name: str) -> Any:
        """Output of a per-vertex value."""
        return self.add("Attribute", attribute_name=name).outputs["Fac"]

    def texture(self, file: Path, data: bool) -> Any:
        """Output of an image; `data` leaves its values unconverted."""
        image = bpy.data.images.load(str(file), check_existing=True)
        image.colorspace_settings.name = "Non-Color" if data else "sRGB"
        return self.add("TexImage", image=image, interpolation="Cubic").outputs[0]

    def bump(self, height: Any, distance: float, strength: float) -> Any:
        """Normal of a height map."""
        node = self.add("Bump", Distance=distance, Strength=strength)
        self.link(height, node.inputs["Height"])
        return node.outputs[0]

    def scaled(self, value: Any, factor: float) -> Any:
        """A value times a constant."""
        node = self.add("Math", operation="MULTIPLY")
        node.inputs[1].default_value = factor
        self.link(value, node.inputs[0])
        return node.outputs[0]


def skin_material(settings: Settings) -> Any:
    """Scattering skin; the lid margin is moist and pink."""
    nodes = Nodes("skin")
    textures = Path(settings["textures"])
    shader = nodes.add(
        "BsdfPrincipled", Specular_IOR_Level=0.5, IOR=1.4, Sheen_Weight=0.05, Sheen_Roughness=0.4
    )
    moist = nodes.attribute("margin")
    colour = nodes.add("Mix", data_type="RGBA")
    colour.inputs[7].default_value = (*settings["margin_colour"], 1)
    nodes.link(moist, colour.inputs[0])
    nodes.link(nodes.texture(textures / "skin_colour.png", False), colour.inputs[6])
    nodes.link(colour.outputs[2], shader.inputs["Base Color"])
    rough = nodes.add("Mix", data_type="FLOAT")
    rough.inputs[3].default_value = 0.24
    nodes.link(moist, rough.inputs[0])
    nodes.link(nodes.texture(textures / "skin_roughness.png", True), rough.inputs[2])
    nodes.link(rough.outputs[0], shader.inputs["Roughness"])
    height = nodes.texture(textures / "skin_height.png", True)
    nodes.link(nodes.bump(height, 1.0, 1.0), shader.inputs["Normal"])
    shader.subsurface_method = "RANDOM_WALK_SKIN"
    shader.inputs["Subsurface Weight"].default_value = 1.0
    shader.inputs["Subsurface Radius"].default_value = (1.0, 0.36, 0.20)
    shader.inputs["Subsurface Scale"].default_value = 1.1
    shader.inputs["Subsurface Anisotropy"].default_value = 0.0
    return nodes.surface(shader)


def eye_material(settings: Settings) -> Any:
    """Iris, and a sclera that scatters and shines."""
    nodes = Nodes("eye")
    textures = Path(settings["textures"])
    shader = nodes.add("BsdfPrincipled", Roughness=0.5, Coat_Roughness=0.07, Coat_IOR=1.33)
    nodes.link(nodes.texture(textures / "eye_colour.png", False), shader.inputs["Base Color"])
    height = nodes.texture(textures / "eye_height.png", True)
    nodes.link(nodes.bump(height, 0.5, 0.6), shader.inputs["Normal"])
    nodes.link(nodes.bump(height, 0.5, 0.12), shader.inputs["Coat Normal"])
    shader.subsurface_method = "RANDOM_WALK"
    shader.inputs["Subsurface Radius"].default_value = (1.0, 0.7, 0.5)
    shader.inputs["Subsurface Scale"].default_value = 0.7
    # Coat and scattering on the sclera alone: the cornea in front already shines over the iris.
    sclera = nodes.attribute("sclera")
    for socket, factor in (("Coat Weight", 0.9), ("Subsurface Weight", 0.45), ("Specular IOR Level", 0.25)):
        nodes.link(nodes.scaled(sclera, factor), shader.inputs[socket])
    return nodes.surface(shader)


def cornea_material(_settings: Settings) -> Any:
    """Glass that lets shadow and diffuse rays through, so that the iris is lit without caustics."""
    nodes = Nodes("cornea")
    glass, clear = nodes.add("BsdfGlass", IOR=1.34, Roughness=0.0), nodes.add("BsdfTransparent")
    path, either, mix = nodes.add("LightPath"), nodes.add("Math", operation="MAXIMUM"), nodes.add("MixShader")
    nodes.link(path.outputs["Is Shadow Ray"], either.inputs[0])
    nodes.link(path.outputs["Is Diffuse Ray"], either.inputs[1])
    nodes.link(either.outputs[0], mix.inputs[0])
    nodes.link(glass.outputs[0], mix.inputs[1])
    nodes.link(clear.outputs[0], mix.inputs[2])
    return nodes.surface(mix)


def tear_material(_settings: Settings) -> Any:
    """Tears: a Fresnel shine over what lies behind."""
    nodes = Nodes("tear")
    gloss, clear = nodes.add("BsdfGlossy", Roughness=0.06), nodes.add("BsdfTransparent")
    fresnel, mix = nodes.add("Fresnel", IOR=1.34), nodes.add("MixShader")
    nodes.link(fresnel.outputs[0], mix.inputs[0])
    nodes.link(clear.outputs[0], mix.inputs[1])
    nodes.link(gloss.outputs[0], mix.inputs[2])
    return nodes.surface(mix)


def flesh_material(settings: Settings) -> Any:
    """Wet pink tissue of the corners."""
    nodes = Nodes("flesh")
    shader = nodes.add("BsdfPrincipled", Roughness=0.25, Coat_Weight=0.6, Coat_Roughness=0.12)
    shader.inputs["Base Color"].default_value = (*settings["flesh_colour"], 1)
    shader.inputs["Subsurface Weight"].default_value = 0.8
    shader.inputs["Subsurface Radius"].default_value = (1.0, 0.35, 0.25)
    shader.inputs["Subsurface Scale"].default_value = 0.8
    noise, place = nodes.add("TexNoise", Scale=1.3, Detail=3.0), nodes.add("TexCoord")
    nodes.link(place.outputs["Object"], noise.inputs["Vector"])
    nodes.link(nodes.bump(noise.outputs[0], 0.3, 0.7), shader.inputs["Normal"])
    return nodes.surface(shader)


def hair_material(name: str, colour: list[float], roughness: float) -> Any:
    """A hair shader of one colour."""
    nodes = Nodes(name)
    shader = nodes.add("BsdfHairPrincipled", parametrization="COLOR", Roughness=roughness)
    shader.inputs["Color"].default_value = (*colour, 1)
    shader.inputs["Radial Roughness"].default_value = 0.5
    return nodes.surface(shader)


def emission(name: str, strength: float) -> Any:
    """Unlit material of one brightness."""
    nodes = Nodes(name)
    return nodes.surface(nodes.add("Emission", Strength=strength))


def materials(kind: str, settings: Settings) -> dict[str, Any]:
    """Materials by name. An eye mask shows the eye white."""
    if kind == "beauty":
        made = {
            name: globals()[f"{name}_material"](settings)
            for name in ("skin", "eye", "cornea", "tear", "flesh")
        }
        made["lash"] = hair_material("lash", settings["lash_colour"], 0.25)
        made["brow"] = hair_material("brow", settings["brow_colour"], 0.34)
        return made
    black, white = emission("black", 0.0), emission("white", 1.0)
    return {"skin": black, "eye": white, "flesh": white}
