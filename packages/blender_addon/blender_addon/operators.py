"""What the panel's buttons do. Each checks everything first, then writes, and can be undone in one step."""

from typing import Any

import bpy
import numpy as np

from blender_addon.channels import Channel, clear_keys, write_keys
from blender_addon.lid_keys import Array, Passage, blink_at, flag_holds, lid_keys, one_blink, passage
from blender_addon.rig import RigError, chosen_channels, rig_guesses
from blender_addon.sound import read_sound
from blender_addon.voice import speech_in_samples
from blink_engine import Performance
from blink_engine.speech import seed_of_speaker, speech_events, speech_states


class _BlinkOperator(bpy.types.Operator):
    """Reports a rig's fault, or the engine's, as one line and writes nothing."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 - Blender reads a plain set

    def execute(self, context: Any) -> set[str]:
        try:
            message = self.run(context, context.object)
        except (RigError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, message)
        return {"FINISHED"}

    def run(self, _context: Any, _rig: Any) -> str:
        """Do it; the message says what was done."""
        raise NotImplementedError


class PALPEBRA_OT_guess(_BlinkOperator):  # noqa: N801 - Blender's rule for names
    """Look for the shape keys or bones that close the eyes"""

    bl_idname, bl_label = "palpebra.guess", "Guess names"

    def run(self, _context: Any, rig: Any) -> str:
        """Fill the table and take its first row."""
        table = rig_guesses(rig)
        if not table:
            raise RigError("no shape key or bone has a name for lids or blinks; choose them by hand")
        settings = rig.palpebra
        settings.guesses.clear()
        for guess in table:
            row = settings.guesses.add()
            row.title, row.left, row.right = guess.title, guess.left, guess.right
        settings.left, settings.right = table[0].left, table[0].right
        return f"{table[0].title}: {table[0].left}, {table[0].right}; {len(table)} in the table"


class PALPEBRA_OT_take_guess(_BlinkOperator):  # noqa: N801
    """Use this row of the table"""

    bl_idname, bl_label = "palpebra.take_guess", "Use"
    row: bpy.props.IntProperty()  # type: ignore[valid-type]

    def run(self, _context: Any, rig: Any) -> str:
        """Take the row's names."""
        settings = rig.palpebra
        if not 0 <= self.row < len(settings.guesses):
            raise RigError("that row is gone; guess again")
        chosen = settings.guesses[self.row]
        settings.left, settings.right = chosen.left, chosen.right
        return f"{chosen.left}, {chosen.right}"


class PALPEBRA_OT_blink(_BlinkOperator):  # noqa: N801
    """One blink that begins at the current frame"""

    bl_idname, bl_label = "palpebra.blink", "Blink here"

    def run(self, context: Any, rig: Any) -> str:
        """Write it and move the seed on, so that the next blink is another one."""
        settings, scene = rig.palpebra, context.scene
        channels = chosen_channels(rig, settings)
        done = one_blink(frames_per_second(scene), _seed(rig))
        start = scene.frame_current
        _write(channels, done, start, start + done.left.size - 1, settings)
        settings.seed += 1
        return f"a blink of {1000 * done.blinks[0].shape.duration_s:.0f} ms at frame {start}"


class PALPEBRA_OT_fill(_BlinkOperator):  # noqa: N801
    """Blinks over the whole range of the scene (its preview range where that is in use)"""

    bl_idname, bl_label = "palpebra.fill", "Fill timeline"

    def run(self, context: Any, rig: Any) -> str:
        """Write them in place of what an earlier fill wrote."""
        settings, asked = rig.palpebra, _passage(context.scene, rig)
        channels = chosen_channels(rig, settings)
        done = passage(asked)
        _write(channels, done, asked.start, asked.end, settings)
        return f"{len(done.blinks)} blinks in {done.left.size / done.fps:.1f} s"


class PALPEBRA_OT_from_speech(_BlinkOperator):  # noqa: N801
    """Blinks at the pauses, ends and turns of a recording"""

    bl_idname, bl_label = "palpebra.from_speech", "Blinks from speech"

    def run(self, context: Any, rig: Any) -> str:
        """Find the speech, pass it to the engine, write its blinks."""
        settings, asked = rig.palpebra, _passage(context.scene, rig)
        channels = chosen_channels(rig, settings)
        offset_s = (settings.sound_start - asked.start) / asked.fps
        stretches = [
            type(one)(one.start_s + offset_s, one.end_s + offset_s)
            for one in speech_in_samples(*read_sound(settings.sound))
            if one.start_s + offset_s >= 0
        ]
        if not stretches:
            raise RigError(
                "there is no speech in that recording within the range; use 'Fill timeline' instead"
            )
        done = passage(asked, speech_events(stretches), speech_states(stretches, asked.state))
        _write(channels, done, asked.start, asked.end, settings)
        return f"{len(stretches)} stretches of speech, {len(done.blinks)} blinks"


class PALPEBRA_OT_reroll(_BlinkOperator):  # noqa: N801
    """Another blink in place of the one at the current frame"""

    bl_idname, bl_label = "palpebra.reroll", "Re-roll this blink"

    def run(self, context: Any, rig: Any) -> str:
        """Take our keys of this blink out and write another of the next seed."""
        settings, scene = rig.palpebra, context.scene
        channels = [one for one in chosen_channels(rig, settings) if one is not None]
        ours = np.unique(np.concatenate([channel.own_keys()[1] for channel in channels]))
        span = blink_at(ours, scene.frame_current, gap=_gap(settings))
        if span is None:
            raise RigError(f"no generated blink at frame {scene.frame_current}; move the cursor onto one")
        done = one_blink(frames_per_second(scene), _seed(rig, later=1))
        start = round(span[0])
        following = ours[ours > span[1]]
        length = done.left.size if not following.size else min(done.left.size, int(following[0]) - start)
        end = max(start + length - 1, round(span[1]))
        _refuse_own(channels, start, end, settings)
        settings.seed += 1
        for channel in channels:
            clear_keys(channel, *span)
        _write(_as_pair(channels), done, start, end, settings)
        return f"another blink, of {1000 * done.blinks[0].shape.duration_s:.0f} ms"


class PALPEBRA_OT_clear(_BlinkOperator):  # noqa: N801
    """Remove all blinks that were written here; your own keys stay"""

    bl_idname, bl_label = "palpebra.clear", "Remove blinks"

    def run(self, _context: Any, rig: Any) -> str:
        """Remove our keys over all time."""
        channels = [one for one in chosen_channels(rig, rig.palpebra) if one is not None]
        return f"{sum(clear_keys(channel, -1e9, 1e9) for channel in channels)} keys removed"


def frames_per_second(scene: Any) -> float:
    """The scene's rate, 23.976 and the like included."""
    return float(scene.render.fps / scene.render.fps_base)


def _seed(rig: Any, later: int = 0) -> int:
    """The engine's seed for a rig: two of one scene and one number do not blink alike."""
    return seed_of_speaker(rig.palpebra.seed + later, rig.name)


def _passage(scene: Any, rig: Any) -> Passage:
    settings = rig.palpebra
    start, end = (
        (scene.frame_preview_start, scene.frame_preview_end)
        if scene.use_preview_range
        else (scene.frame_start, scene.frame_end)
    )
    rate, fps = settings.rate or None, frames_per_second(scene)
    keyed = Channel(rig, "palpebra.hold", -1, 0.0, 1.0, "the flag").curve()
    # Without keys the flag is as it is set, over the whole range.
    up = [keyed.evaluate(frame) >= 0.5 if keyed else settings.hold for frame in range(start, end + 1)]
    if up and all(up):
        raise RigError(
            "'Eyes stay open' is on in the whole range, so no blink can come; key it, or turn it off"
        )
    return Passage(start, end, fps, _seed(rig), settings.state, rate, flag_holds(np.array(up, bool), fps))


def _write(
    channels: tuple[Channel, Channel | None], done: Performance, start: int, end: int, settings: Any
) -> None:
    left, right = channels
    _refuse_own([one for one in channels if one is not None], start, end, settings)
    curves: list[tuple[Channel, Array]] = [(left, done.left if right else np.maximum(done.left, done.right))]
    if right is not None:
        curves.append((right, done.right))
    for channel, closure in curves:
        keys = lid_keys(closure[: end - start + 1], start, settings.density)
        write_keys(channel, keys, start, end, settings.density == "FEW")


def _refuse_own(channels: list[Channel], start: int, end: int, settings: Any) -> None:
    if settings.replace:
        return
    for channel in channels:
        own = channel.own_keys()[0]
        inside = int(((own >= start - 0.5) & (own <= end + 0.5)).sum())
        if inside:
            raise RigError(
                f"{channel.title} has {inside} manual keys in frames {start} to {end}; select 'Replace my "
                "own keys' or choose another range"
            )


def _as_pair(channels: list[Channel]) -> tuple[Channel, Channel | None]:
    return channels[0], channels[1] if len(channels) == 2 else None


def _gap(settings: Any) -> float:
    """How far apart keys of one blink may be: those of every frame, or few over half a second."""
    return 1.5 if settings.density == "EVERY_FRAME" else 12.5


CLASSES = (
    PALPEBRA_OT_guess,
    PALPEBRA_OT_take_guess,
    PALPEBRA_OT_blink,
    PALPEBRA_OT_fill,
    PALPEBRA_OT_from_speech,
    PALPEBRA_OT_reroll,
    PALPEBRA_OT_clear,
)


def register() -> None:
    """Make the operators known to Blender."""
    for one in CLASSES:
        bpy.utils.register_class(one)


def unregister() -> None:
    """Take them away again."""
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
