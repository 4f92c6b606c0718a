"""The command `stimuli`: lists the commands; each lives with its subject and is loaded when called."""

from experiments.command_groups import lazy_app
from experiments.command_line import run_command_line

COMMANDS = {
    "actor": (
        "stimuli_builder.actor.cli",
        "Generate a high-speed recording of a synthetic actor, with exact ground truth and label files.",
    ),
    "track": (
        "stimuli_builder.tracking.cli",
        "Track the eyelids in a recording with the coupled active appearance model.",
    ),
    "train": (
        "stimuli_builder.tracking.cli",
        "Train the model on labeled frames, report its accuracy per fold, and save it.",
    ),
    "accuracy": (
        "stimuli_builder.tracking.cli",
        "Compare a track of the synthetic actor with its exact ground truth.",
    ),
    "label": (
        "stimuli_builder.tracking.cli",
        "Propose labels for varied frames with the eye detector, for correction by hand.",
    ),
    "iris": (
        "stimuli_builder.tracking.cli",
        "Measure the irises in a tracked recording, and estimate the millimeters per pixel.",
    ),
    "blinks": (
        "stimuli_builder.blinks.cli",
        "Detect and measure the blinks in a series (eye aspect ratio or distance) or a track.",
    ),
    "profiles": (
        "stimuli_builder.blinks.cli",
        "The blink profiles that ship with the project.",
    ),
    "model": (
        "stimuli_builder.blinks.cli",
        "The PCA blink model: learn from recorded blinks, generate new ones, export curves for animation.",
    ),
    "performance": (
        "stimuli_builder.performance.cli",
        "Generate the blinks of a performance, timed by pauses and turns of speech.",
    ),
    "bake": (
        "stimuli_builder.characters.cli",
        "Render a character's atlas of baked pictures.",
    ),
    "character": (
        "stimuli_builder.characters.cli",
        "List the installed characters, and restore a character of an earlier release.",
    ),
    "plan": (
        "stimuli_builder.clips.cli",
        "Print an experiment's design: factors, cells, clips, trials, blocks and expected minutes.",
    ),
    "build": (
        "stimuli_builder.clips.cli",
        "Build an experiment's clips (H.264 in MP4) and manifest.json.",
    ),
    "checks": (
        "stimuli_builder.clips.cli",
        "Generate the clips of a study's motion checks, whose content is visible only in motion.",
    ),
    "clip": (
        "stimuli_builder.clips.cli",
        "Render one clip from a blink profile and a character.",
    ),
    "manifest": (
        "stimuli_builder.clips.cli",
        "Write manifest.json for a folder of your own clips, so that a server can use them.",
    ),
    "siti": (
        "stimuli_builder.clips.cli",
        "Measure how much detail (SI) and motion (TI) videos have, by ITU-T P.910.",
    ),
    "strips": (
        "stimuli_builder.clips.cli",
        "Write picture strips of the shipped characters at 33 closures, for the dashboard's blinks page.",
    ),
    "scope": (
        "stimuli_builder.sync_patch.cli",
        "Read the sync patch from a film of the screen or a photodiode: missing frames and intervals.",
    ),
    "verify": (
        "stimuli_builder.clips.cli",
        "Check a folder of clips against its manifest: presence, hashes, frame counts, timing and eyelid "
        "opening.",
    ),
}
"""Command -> the module whose `register` adds it, and the line of help that lists it."""


app = lazy_app(
    "stimuli",
    "From a recorded face to rated clips: track eyelids, measure blinks, build stimuli.",
    COMMANDS,
)


def main() -> None:
    """Run `stimuli`; bad input ends in one line on stderr and exit code 2."""
    run_command_line(app)
