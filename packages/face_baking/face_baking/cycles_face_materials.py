"""Shaders of a face from the face kit, in cm. Runs in Blender's own Python: see cycles_face_worker.py."""

from typing import Any

import bpy
import numpy as np
from cycles_face_nodes import Nodes
from cycles_face_wet import film, tear

# Optical depths of the pigments per channel, over the color of skin without them.
BASE = (0.86, 0.73, 0.595)
SKIN_SHARE = "skin"
"""Pass that says which share of a pixel is skin."""
SHADE = (0.85, 1.07, 1.2)
"""Exponents (red, green, blue) of the light that lids leave near their edges: it came by way of skin."""
FLUSH = (0.95, 0.53, 0.51)
"""Share of light (red, green, blue) that the eye's white keeps at its nasal end, which turns to flesh."""
DARK_MELANIN = 0.9
"""Optical depth of melanin above which skin scatters and shines as dark skin does."""
MELANIN, BLOOD = (1.0, 1.33, 1.64), (0.06, 0.84, 0.86)


def materials(settings: dict[str, Any]) -> dict[str, Any]:
    """Every material by name."""
    look = settings["look"]
    colour, height = _eye_images(settings["textures"])
    return {
        "skin": skin(look),
        "eye": eye(colour, height),
        "film": film(settings["lights"]),
        "tear": tear(settings["lights"]),
        "spectacles": spectacles(),
        "lash": hair("lash", [min(0.009, c * 0.25) for c in look["hair"]], 0.25, (0.55, 1.9)),
        "brow": hair("brow", look["hair"], 0.33, (0.7, 1.45)),
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
    """Iris and sclera under the film; `shade` darkens what lies near a lid, `flush` reddens the nasal end."""
    n = Nodes("eye")
    albedo = n.add("TexImage", image=colour, interpolation="Cubic", extension="EXTEND").outputs[0]
    relief = n.add("TexImage", image=height, interpolation="Cubic", extension="EXTEND").outputs[0]
    shade = [n.math("POWER", n.attribute("shade"), exponent) for exponent in SHADE]
    pink = [n.math("MULTIPLY_ADD", n.attribute("flush"), share - 1, 1.0) for share in FLUSH]
    left = [n.math("MULTIPLY", *both) for both in zip(shade, pink, strict=True)]
    shaded = n.vector("MULTIPLY", albedo, n.add("CombineXYZ", X=left[0], Y=left[1], Z=left[2]).outputs[0])
    shader = n.add("BsdfPrincipled")
    # The corner's flesh lies bare and wet; elsewhere the film before the eye mirrors.
    n.put(n.math("MULTIPLY", n.attribute("flush"), 0.7), shader.inputs["Specular IOR Level"])
    n.put(n.math("MULTIPLY_ADD", n.attribute("flush"), -0.36, 0.5), shader.inputs["Roughness"])
    n.put(shaded, shader.inputs["Base Color"])
    n.put(n.add("Bump", Strength=0.6, Distance=0.04, Height=relief).outputs[0], shader.inputs["Normal"])
    shader.subsurface_method = "RANDOM_WALK"
    n.put(n.math("MULTIPLY", n.attribute("sclera"), 0.35), shader.inputs["Subsurface Weight"])
    shader.inputs["Subsurface Radius"].default_value = (1.0, 0.7, 0.5)
    shader.inputs["Subsurface Scale"].default_value = 0.07
    return n.surface(shader)


def spectacles() -> Any:
    """Dark plastic of a pair of glasses' rims."""
    n = Nodes("spectacles")
    shader = n.add("BsdfPrincipled", Roughness=0.3, Specular_IOR_Level=0.5)
    shader.inputs["Base Color"].default_value = (0.02, 0.016, 0.014, 1)
    return n.surface(shader)


def hair(name: str, colour: list[float], rough: float, lightness: tuple[float, float]) -> Any:
    """Hairs of one color, each a little lighter or darker, between two shares of it."""
    n = Nodes(name)
    info = n.add("HairInfo")
    varied = n.add("VectorMath", operation="SCALE")
    varied.inputs[0].default_value = colour
    lighter = n.ramp(info.outputs["Random"], 0.0, 1.0, *lightness, False)
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
