"""The panel 'Blinks' in the sidebar of the 3D view."""

from typing import Any

import bpy


class PALPEBRA_PT_blinks(bpy.types.Panel):  # noqa: N801 - Blender's rule for names
    """Everything on one page: names, then what to write."""

    bl_label = "Blinks"
    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "Animation"

    def draw(self, context: Any) -> None:
        """Draw it."""
        rig, layout = context.object, self.layout
        if rig is None or rig.type not in ("MESH", "ARMATURE"):
            layout.label(text="Select the face or its armature", icon="INFO")
            return
        settings = rig.palpebra
        _draw_names(layout.box(), rig, settings)
        box = layout.box()
        for name in ("state", "rate", "seed", "hold", "density", "replace"):
            box.prop(settings, name)
        column = layout.column(align=True)
        column.operator("palpebra.blink", icon="KEY_HLT")
        column.operator("palpebra.fill", icon="TIME")
        column.operator("palpebra.reroll", icon="FILE_REFRESH")
        column.operator("palpebra.clear", icon="TRASH")
        box = layout.box()
        box.prop(settings, "sound")
        box.prop(settings, "sound_start")
        box.operator("palpebra.from_speech", icon="SPEAKER")


def _draw_names(box: Any, rig: Any, settings: Any) -> None:
    box.operator("palpebra.guess", icon="VIEWZOOM")
    for number, row in enumerate(settings.guesses[:6]):
        line = box.row()
        line.label(text=f"{row.title}: {row.left}, {row.right}")
        line.operator("palpebra.take_guess", text="Use").row = number
    if rig.type == "MESH" and rig.data.shape_keys is not None:
        for name in ("left", "right"):
            box.prop_search(settings, name, rig.data.shape_keys, "key_blocks", icon="SHAPEKEY_DATA")
    elif rig.type == "ARMATURE":
        for name in ("left", "right"):
            box.prop_search(settings, name, rig.pose, "bones", icon="BONE_DATA")
        box.prop(settings, "bone_motion")
        box.prop(settings, "bone_axis")
        box.prop(settings, "bone_closed_rad" if settings.bone_motion == "ROTATION" else "bone_closed_m")


def register() -> None:
    """Show the panel."""
    bpy.utils.register_class(PALPEBRA_PT_blinks)


def unregister() -> None:
    """Hide it again."""
    bpy.utils.unregister_class(PALPEBRA_PT_blinks)
