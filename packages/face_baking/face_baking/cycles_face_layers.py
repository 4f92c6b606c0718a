"""A face in two layers, skin and eyes apart from hair, and the picture that they make. Runs under bpy.

Hair is rendered alone, before skin that is cut out, with more samples and without denoiser: denoised with the
skin, lashes and brows come out as strokes of a pen. Skin is rendered without the light below it, which
skin_light.py adds. See cycles_face_worker.py.
"""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import OpenEXR
from cycles_face_denoiser import Denoiser
from cycles_face_materials import DARK_MELANIN, SKIN_SHARE
from hair_light import without_dots, without_specks
from skin_light import REACH_CM, scattered

FACE, HAIR = "face", "hair"
FACE_PASSES = (
    "Combined",
    "Diffuse Direct",
    "Diffuse Indirect",
    "Diffuse Color",
    "Denoising Normal",
    "Denoising Albedo",
    SKIN_SHARE,
)
HAIR_SAMPLES = 4
"""Samples of hair over those of skin: single hairs are thinner than a pixel, and most pixels have none."""
HAIR_NOISE = 0.0002
"""Cycles' adaptive threshold: so low that a pixel with any hair in it takes all its samples."""
DARK_SKIN = 0.77
"""Reach of light below skin with more melanin than DARK_MELANIN, over that below light skin."""


def collection(name: str) -> Any:
    """The collection of a layer's parts, made when first asked for."""
    if name not in bpy.data.collections:
        bpy.context.scene.collection.children.link(bpy.data.collections.new(name))
    return bpy.data.collections[name]


class Layers:
    """The scene's two layers, and what is made of what they render."""

    def __init__(self, settings: dict[str, Any]) -> None:
        scene = bpy.context.scene
        self._face, self._hair = scene.view_layers[0], scene.view_layers.new(HAIR)
        self._face.name = FACE
        self._face.layer_collection.children[HAIR].indirect_only = True
        self._hair.layer_collection.children[FACE].holdout = True
        # The hair's are not read; Cycles 5.0.1 ends at the second layer where the first alone has them.
        self._face.cycles.denoising_store_passes = self._hair.cycles.denoising_store_passes = True
        self._face.use_pass_diffuse_direct = self._face.use_pass_diffuse_indirect = True
        self._face.use_pass_diffuse_color = True
        mask = self._face.aovs.add()
        mask.name, mask.type = SKIN_SHARE, "VALUE"
        lights = settings["lights"]
        self._ground = np.array(lights["room"], np.float32) * lights["room_strength"]
        density = settings["size_px"][0] / settings["width_cm"]
        share = DARK_SKIN if settings["look"]["melanin"] > DARK_MELANIN else 1.0
        self._reach_px = tuple(reach * share * density for reach in REACH_CM)
        self._denoiser = Denoiser(settings["threads"])

    def picture(self, draft: Path, samples: int) -> Any:
        """(h, w, 3) scene-linear float32 of the render's border."""
        face = self._rendered(self._face, draft, samples)
        hair = self._rendered(self._hair, draft, samples * HAIR_SAMPLES, least=max(4, samples * 2 // 3))
        behind = self._lit(face) + (1 - face["Combined"][..., 3:]) * self._ground
        before = without_specks(hair["Combined"])
        return without_dots(behind * (1 - before[..., 3:]) + before[..., :3], before[..., 3])

    def _lit(self, face: dict[str, Any]) -> Any:
        """Skin and eyes, light below the skin included.

        F = D(C - m A E) + m A S(D(E))                                                                     (1)

        Letters: C the render, m share of skin, A color and E diffuse light of the pixel, S scattered, D
        denoised. A has no noise and is not smoothed. Noise is taken away before it is scattered, which would
        make blotches of it that no denoiser takes for noise.
        """
        skin, colour = face[SKIN_SHARE], face["Diffuse Color"]
        light = face["Diffuse Direct"] + face["Diffuse Indirect"]
        normal = self._denoiser.guide("normal", face["Denoising Normal"])
        albedo = self._denoiser.guide("albedo", face["Denoising Albedo"])
        share = skin[..., None] * colour
        above = self._denoiser.light(face["Combined"][..., :3] - share * light, albedo, normal)
        edges = np.repeat(skin[..., None], 3, axis=2)
        clean = self._denoiser.light(light, edges, normal)
        return above + share * scattered(clean, skin, self._reach_px)

    def _rendered(self, layer: Any, draft: Path, samples: int, least: int = 0) -> dict[str, Any]:
        """Passes of one layer by name, (h, w) or (h, w, channels) float32."""
        scene = bpy.context.scene
        for each in (self._face, self._hair):
            each.use = each is layer
        # Adaptive sampling stays switched on for both, since Cycles breaks down where it is switched.
        scene.cycles.samples, scene.cycles.adaptive_min_samples = samples, least or samples
        scene.render.filepath = str(draft)
        try:
            bpy.ops.render.render(write_still=True)
            return read_passes(draft, layer.name)
        finally:
            draft.unlink(missing_ok=True)


def read_passes(file: Path, layer: str) -> dict[str, Any]:
    """The passes of a file of many layers, by their names without the layer's.

    Raises
    ------
    RuntimeError
        A pass that this module reads is not in the file.
    """
    passes: dict[str, Any] = {}
    axes: dict[str, dict[str, Any]] = {}
    with OpenEXR.File(str(file)) as stored:
        for part in stored.parts:
            for channel, content in part.channels.items():
                name = channel.removeprefix(f"{layer}.")
                pixels = np.array(content.pixels, np.float32)
                stem, _, axis = name.rpartition(".")
                if axis in ("X", "Y", "Z") and pixels.ndim == 2:
                    axes.setdefault(stem, {})[axis] = pixels
                else:
                    passes[name] = pixels
    for stem, parts in axes.items():
        planes = [parts[axis] for axis in sorted(parts)]
        passes[stem] = planes[0] if len(planes) == 1 else np.stack(planes, -1)
    missing = [name for name in (FACE_PASSES if layer == FACE else ("Combined",)) if name not in passes]
    if missing:
        raise RuntimeError(f"Blender wrote no pass {missing[0]!r}, but {', '.join(sorted(passes))}")
    return passes
