"""Shaders of a face from the face kit, in cm. Runs in Blender's own Python: see cycles_face_worker.py."""

import math
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

# Optical depths of the pigments per channel, over the colour of skin without them.
BASE = (0.86, 0.73, 0.595)
FILM_IOR = 1.376
ROOM_MIRRORED = 0.5
"""Share of the room's light that the eyes mirror: half of what lies about them is the face itself."""
SKIN_SHARE = "skin"
"""Pass that says which share of a pixel is skin."""
DARK_MELANIN = 0.9
"""Optical depth of melanin above which skin scatters and shines as dark skin does."""
ROUNDED = 3.0
"""Exponent of a lamp's outline as the eyes mirror it: 2 is an ellipse, and beyond 8 a square."""
HOT = 1.8
"""Light of a mirrored lamp's middle over that of its rim: the bulb behind a soft box's cloth."""
MELANIN, BLOOD = (1.0, 1.33, 1.64), (0.06, 0.84, 0.86)


class Nodes:
    """Builds a material's node tree; values may be numbers or the outputs of other nodes."""

    def __init__(self, name: str) -> None:
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        self.out = self.add("OutputMaterial")

    def add(self, kind: str, **settings: Any) -> Any:
        """Add a node; a setting is a property of it or, with _ for spaces, one of its inputs."""
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for key, value in settings.items():
            if hasattr(node, key):
                setattr(node, key, value)
            else:
                self.put(value, node.inputs[key.replace("_", " ")])
        return node

    def put(self, value: Any, socket: Any) -> None:
        """Link an output or set a number."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation: str, *values: Any) -> Any:
        """Result of a Math node."""
        node = self.add("Math", operation=operation)
        for k, value in enumerate(values):
            self.put(value, node.inputs[k])
        return node.outputs[0]

    def vector(self, operation: str, *values: Any, scale: Any = None) -> Any:
        """Result of a VectorMath node; a number where the operation gives one."""
        node = self.add("VectorMath", operation=operation)
        for k, value in enumerate(values):
            self.put(value, node.inputs[k])
        if scale is not None:
            self.put(scale, node.inputs["Scale"])
        return node.outputs["Value" if operation == "DOT_PRODUCT" else "Vector"]

    def attribute(self, name: str, vector: bool = False) -> Any:
        """A per-vertex value."""
        return self.add("Attribute", attribute_name=name).outputs["Vector" if vector else "Fac"]

    def noise(
        self, at: Any, scale: float, detail: float = 3.0, rough: float = 0.55, distortion: float = 0.0
    ) -> Any:
        """Noise in 0-1."""
        return self.add(
            "TexNoise", Vector=at, Scale=scale, Detail=detail, Roughness=rough, Distortion=distortion
        ).outputs[0]

    def ramp(self, x: Any, a: float, b: float, c: float = 0.0, d: float = 1.0, soft: bool = True) -> Any:
        """Map a-b to c-d."""
        node = self.add("MapRange", interpolation_type="SMOOTHSTEP" if soft else "LINEAR")
        for k, value in enumerate((x, a, b, c, d)):
            self.put(value, node.inputs[k])
        return node.outputs[0]

    def surface(self, node: Any) -> Any:
        """Use a shader as the material's surface."""
        self.tree.links.new(node.outputs[0], self.out.inputs["Surface"])
        return self.material


def materials(settings: dict[str, Any]) -> dict[str, Any]:
    """Every material by name."""
    look = settings["look"]
    colour, height = _eye_images(settings["textures"])
    return {
        "skin": skin(look),
        "eye": eye(colour, height),
        "film": film(settings["lights"]),
        "tear": tear(settings["lights"]),
        "flesh": flesh(look),
        "spectacles": spectacles(),
        "lash": hair("lash", [min(0.008, c * 0.25) for c in look["hair"]], 0.25),
        "brow": hair("brow", look["hair"], 0.33),
    }


def skin(look: dict[str, Any]) -> Any:
    """Pigments in layers, pores, furrows and lid lines as relief; skin_light.py adds the light below it."""
    n = Nodes("skin")
    warp, wet = n.attribute("warp", True), n.attribute("wet")
    pits = n.add("TexVoronoi", Vector=warp, Scale=8.5, Randomness=1.0)
    pit = n.math("MULTIPLY", n.ramp(pits.outputs["Distance"], 0.06, 0.30, 1.0, 0.0), n.attribute("pore"))
    net = n.add("TexVoronoi", Vector=warp, Scale=17.0, Randomness=0.9, feature="DISTANCE_TO_EDGE")
    furrow = n.math("MULTIPLY", n.ramp(net.outputs["Distance"], 0.0, 0.14, 1.0, 0.0), n.attribute("net"))
    lines = n.noise(n.attribute("lidc", True), 1.0, 2, 0.55, 0.25)
    ridge = n.math("ABSOLUTE", n.math("SUBTRACT", lines, 0.5))
    line = n.math("MULTIPLY", n.ramp(ridge, 0.0, 0.07, 1.0, 0.0), n.attribute("fine"))
    grain = n.noise(n.attribute("rest", True), 26.0, 2, 0.6)
    height = n.math("MULTIPLY", grain, 0.0055)
    for part, depth in ((pit, 0.012), (furrow, 0.0045), (line, 0.011)):
        height = n.math("SUBTRACT", height, n.math("MULTIPLY", part, depth))
    dry = n.math("SUBTRACT", 1.0, wet)
    bump = n.add("Bump", Strength=1.0, Distance=1.0, Height=n.math("MULTIPLY", height, dry)).outputs[0]
    shader, shine = n.add("BsdfPrincipled", IOR=1.4), n.attribute("shine")
    n.put(_skin_colour(n, grain, pit, furrow, line), shader.inputs["Base Color"])
    n.put(n.math("SUBTRACT", n.attribute("rough"), n.math("MULTIPLY", wet, 0.26)), shader.inputs["Roughness"])
    dark = look["melanin"] > DARK_MELANIN
    for name, value in (
        ("Normal", bump),
        ("Coat Normal", bump),
        ("Specular IOR Level", n.math("MULTIPLY", shine, 0.5)),
        ("Coat Weight", n.math("MULTIPLY", shine, 0.10 if dark else 0.13)),
        ("Coat Roughness", 0.26),
        ("Sheen Weight", 0.0 if dark else 0.03),
    ):
        n.put(value, shader.inputs[name])
    n.add("OutputAOV", aov_name=SKIN_SHARE, Value=1.0)
    return n.surface(shader)


def _skin_colour(n: Nodes, grain: Any, pit: Any, furrow: Any, line: Any) -> Any:
    """Light that both pigments leave; its fine variation is multiplied in after the denoiser."""
    melanin, blood = n.attribute("mel"), n.attribute("hem")
    melanin = n.math("MULTIPLY", melanin, n.ramp(grain, 0.3, 0.7, 0.88, 1.14, False))
    for part, more in ((pit, 0.40), (furrow, 0.10), (line, 0.14)):
        melanin = n.math("ADD", melanin, n.math("MULTIPLY", n.math("MULTIPLY", melanin, part), more))
    blood = n.math("ADD", blood, n.math("MULTIPLY", pit, 0.05))
    colour = n.add("CombineColor")
    for k in range(3):
        depth = n.math("ADD", n.math("MULTIPLY", melanin, MELANIN[k]), n.math("MULTIPLY", blood, BLOOD[k]))
        n.put(
            n.math("MULTIPLY", n.math("EXPONENT", n.math("MULTIPLY", depth, -1.0)), BASE[k]), colour.inputs[k]
        )
    return colour.outputs[0]


def eye(colour: Any, height: Any) -> Any:
    """Iris and sclera under the film; `shade` darkens what lies near a lid."""
    n = Nodes("eye")
    albedo = n.add("TexImage", image=colour, interpolation="Cubic", extension="EXTEND").outputs[0]
    relief = n.add("TexImage", image=height, interpolation="Cubic", extension="EXTEND").outputs[0]
    shaded = n.add("VectorMath", operation="SCALE")
    n.put(albedo, shaded.inputs[0])
    n.put(n.attribute("shade"), shaded.inputs["Scale"])
    shader = n.add("BsdfPrincipled", Roughness=0.5, Specular_IOR_Level=0.0)
    n.put(shaded.outputs[0], shader.inputs["Base Color"])
    n.put(n.add("Bump", Strength=0.6, Distance=0.04, Height=relief).outputs[0], shader.inputs["Normal"])
    shader.subsurface_method = "RANDOM_WALK"
    n.put(n.math("MULTIPLY", n.attribute("sclera"), 0.35), shader.inputs["Subsurface Weight"])
    shader.inputs["Subsurface Radius"].default_value = (1.0, 0.7, 0.5)
    shader.inputs["Subsurface Scale"].default_value = 0.07
    return n.surface(shader)


def film(lights: dict[str, Any]) -> Any:
    """Clear wet layer: refracts to the camera and shines with what it mirrors, is open to light on its way.

    Mirrored lamps are worked out by their rectangles. As a mirror it would be asked once in forty samples,
    so that at 12 samples a third of a level's error stood on the hundredth part that is catchlight.
    """
    n = Nodes("film")
    coordinates = n.add("TexCoord").outputs["Object"]
    ripples = n.math("MULTIPLY", n.noise(coordinates, 9.0, 2), 0.0004)
    normal = n.add("Bump", Strength=1.0, Distance=1.0, Height=ripples).outputs[0]
    mirrored = n.add("Fresnel", IOR=FILM_IOR, Normal=normal).outputs[0]
    through = n.math("SUBTRACT", 1.0, mirrored)
    ray, clear = n.add("LightPath"), n.add("BsdfTransparent")
    glass = n.add("BsdfRefraction", IOR=FILM_IOR, Roughness=0.0, Normal=normal)
    n.put(n.add("CombineXYZ", X=through, Y=through, Z=through).outputs[0], glass.inputs["Color"])
    shine = n.add("Emission", Color=reflected(n, normal, lights))
    n.put(n.math("MULTIPLY", mirrored, ray.outputs["Is Camera Ray"]), shine.inputs["Strength"])
    seen, mix = n.add("AddShader"), n.add("MixShader")
    n.put(glass.outputs[0], seen.inputs[0])
    n.put(shine.outputs[0], seen.inputs[1])
    n.put(n.math("MAXIMUM", ray.outputs["Is Shadow Ray"], ray.outputs["Is Diffuse Ray"]), mix.inputs[0])
    n.put(seen.outputs[0], mix.inputs[1])
    n.put(clear.outputs[0], mix.inputs[2])
    return n.surface(mix)


def reflected(n: Nodes, normal: Any, lights: dict[str, Any], room: float = ROOM_MIRRORED) -> Any:
    """Light that comes from where a mirror of that normal looks: the room's, and each mirrored lamp's."""
    geometry = n.add("NewGeometry")
    away = n.vector("REFLECT", n.vector("SCALE", geometry.outputs["Incoming"], scale=-1.0), normal)
    total = n.vector("SCALE", lights["room"], scale=lights["room_strength"] * room)
    for lamp in lights["areas"]:
        if not lamp.get("in_eyes", lamp["mirrored"]):
            continue
        share = _lamp_share(n, geometry.outputs["Position"], away, lamp)
        radiance = lamp["energy"] / (math.pi * lamp["size"][0] * lamp["size"][1])
        colour = [c * radiance for c in lamp["colour"]]
        total = n.vector("ADD", total, n.vector("SCALE", colour, scale=share))
    return total


def _lamp_share(n: Nodes, start: Any, away: Any, lamp: dict[str, Any]) -> Any:
    """1 where a ray meets the lamp, a rectangle with rounded corners, 0 beside it, with a soft box's edge."""
    centre = Vector(lamp["place"])
    turned = (Vector(lamp["aim"]) - centre).to_track_quat("-Z", "Y")
    across, up, back = (turned @ Vector(axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    towards = n.vector("SUBTRACT", list(centre), start)
    facing = n.vector("DOT_PRODUCT", away, list(back))
    way = n.math("DIVIDE", n.vector("DOT_PRODUCT", towards, list(back)), facing)
    off = n.vector("SUBTRACT", n.vector("SCALE", away, scale=way), towards)
    share = n.math("MULTIPLY", n.math("GREATER_THAN", way, 0.0), n.math("GREATER_THAN", facing, 0.0))
    beside = []
    for axis, size in ((across, lamp["size"][0]), (up, lamp["size"][1])):
        aside = n.math("ABSOLUTE", n.vector("DOT_PRODUCT", off, [c * 2 / size for c in axis]))
        beside.append(n.math("POWER", aside, ROUNDED))
    edge = n.math("POWER", n.math("ADD", *beside), 1 / ROUNDED)
    hot = n.ramp(edge, 0.0, 1.0, HOT, 1.0)
    return n.math("MULTIPLY", n.math("MULTIPLY", share, hot), n.ramp(edge, 0.65, 1.10, 1.0, 0.0))


def tear(lights: dict[str, Any]) -> Any:
    """Thin water: it passes what lies behind and shines with the lamps; the lids are all else it mirrors."""
    n = Nodes("tear")
    # The rim of so thin a line would mirror all there is, as white dots that come and go with the samples.
    mirrored, ray = n.math("MINIMUM", n.add("Fresnel", IOR=1.34).outputs[0], 0.05), n.add("LightPath")
    shine = n.add("Emission", Color=reflected(n, n.add("NewGeometry").outputs["Normal"], lights, room=0.0))
    n.put(n.math("MULTIPLY", mirrored, ray.outputs["Is Camera Ray"]), shine.inputs["Strength"])
    both = n.add("AddShader")
    n.put(n.add("BsdfTransparent").outputs[0], both.inputs[0])
    n.put(shine.outputs[0], both.inputs[1])
    return n.surface(both)


def flesh(look: dict[str, Any]) -> Any:
    """The nasal corner's moist flesh."""
    n = Nodes("flesh")
    dark = math.exp(-0.25 * look["melanin"])
    shader = n.add("BsdfPrincipled", Roughness=0.45, Coat_Weight=0.2, Coat_Roughness=0.2)
    shader.inputs["Base Color"].default_value = (0.64 * dark, 0.37 * dark, 0.31 * dark, 1)
    shader.inputs["Subsurface Weight"].default_value = 0.8
    shader.inputs["Subsurface Radius"].default_value = (1.0, 0.35, 0.25)
    shader.inputs["Subsurface Scale"].default_value = 0.08
    wrinkles = n.noise(n.add("TexCoord").outputs["Object"], 14.0, 3)
    n.put(n.add("Bump", Strength=0.5, Distance=0.02, Height=wrinkles).outputs[0], shader.inputs["Normal"])
    return n.surface(shader)


def spectacles() -> Any:
    """Dark plastic of a pair of glasses' rims."""
    n = Nodes("spectacles")
    shader = n.add("BsdfPrincipled", Roughness=0.3, Specular_IOR_Level=0.5)
    shader.inputs["Base Color"].default_value = (0.02, 0.016, 0.014, 1)
    return n.surface(shader)


def hair(name: str, colour: list[float], rough: float) -> Any:
    """Hairs of one colour, each a little lighter or darker."""
    n = Nodes(name)
    info = n.add("HairInfo")
    varied = n.add("VectorMath", operation="SCALE")
    varied.inputs[0].default_value = colour
    lighter = n.ramp(info.outputs["Random"], 0.0, 1.0, 0.55, 1.9, False)
    tipped = n.math("MULTIPLY", lighter, n.ramp(info.outputs["Intercept"], 0.3, 1.0, 1.0, 1.5, False))
    n.put(tipped, varied.inputs["Scale"])
    shader = n.add("BsdfHairPrincipled", parametrization="COLOR", Roughness=rough)
    n.put(varied.outputs[0], shader.inputs["Color"])
    shader.inputs["Radial Roughness"].default_value = 0.5
    return n.surface(shader)


def _eye_images(file: str) -> tuple[Any, Any]:
    with np.load(file) as stored:
        return _image("eye_colour", stored["colour"], False), _image("eye_height", stored["height"], True)


def _image(name: str, pixels: Any, data: bool) -> Any:
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True, is_data=data)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels if pixels.ndim == 3 else pixels[..., None]
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    return image
