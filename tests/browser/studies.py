"""Short studies for the browser tests: every kind of screen, few clips."""

STUDY = """
name = "browser"
title = "How natural does this blink look?"
languages = ["en", "de"]

[[factors]]
name = "character"
label = "Character"
levels = [{ name = "a", label = "A" }, { name = "b", label = "B" }]

[exemplars]
per_cell = 3

[blocks]
split_by = "character"
order = "fixed"
break_seconds_min = 1

[practice]
trials = 1

[attention]
per_block = 1

[display]
calibrate = "required"
viewing_distance = true
full_screen = false
minimum_width_px = 320
minimum_height_px = 300

# A shared machine's lost pictures fail no play: its clip would come again where a test expects the next.
[playback]
failed_missing_frames = 10_000
failed_longest_gap_ms = 600_000.0

[trial]
kind = "clip_rating"
[trial.scale]
question = { en = "How natural was this blink?", de = "Wie natürlich war dieser Lidschlag?" }
low = { en = "very unnatural", de = "sehr unnatürlich" }
high = { en = "very natural", de = "sehr natürlich" }

[[forms]]
name = "demographics"
title = { en = "About you", de = "Über Sie" }
[[forms.fields]]
type = "number"
name = "age"
label = { en = "Your age in years", de = "Ihr Alter in Jahren" }
required = true
minimum = 18
maximum = 120
[[forms.fields]]
type = "choice"
name = "vision"
label = { en = "Your eyesight at this screen", de = "Ihre Sehkraft an diesem Bildschirm" }
required = true
options = [
    { value = "normal", label = { en = "Normal without glasses", de = "Normal ohne Brille" } },
    { value = "corrected", label = { en = "Normal with glasses", de = "Normal mit Brille" } },
]
[[forms.fields]]
type = "likert"
name = "tired"
label = { en = "How awake do you feel?", de = "Wie wach fühlen Sie sich?" }
low = { en = "tired", de = "müde" }
high = { en = "wide awake", de = "hellwach" }
[[forms.fields]]
type = "text"
name = "remarks"
label = { en = "Anything we should know", de = "Was wir wissen sollten" }
help = { en = "For instance a lazy eye.", de = "Zum Beispiel eine Sehschwäche." }

[[forms]]
name = "afterwards"
when = "after"
title = { en = "To finish", de = "Zum Schluss" }
[[forms.fields]]
type = "multiple_choice"
name = "noticed"
label = { en = "What did you notice?", de = "Was ist Ihnen aufgefallen?" }
options = [
    { value = "speed", label = { en = "The speed", de = "Das Tempo" } },
    { value = "lid", label = { en = "The lower lid", de = "Das Unterlid" } },
]

[texts.en]
consent = '''
# How natural does this blink look?

You are invited to a study on how people see eye blinks. You will watch very short clips of a pair of eyes and
say how natural each blink looks.

- Taking part is voluntary. You can stop at any time by closing the page.
- We store your answers and how the clips were shown. We store neither your name nor your internet address.
'''
instructions = '''
# What you will do

1. Press **Space** or **Enter**, or use the button, to start a clip. You see it **once**, so look closely.
2. Then rate the blink from **1** (very unnatural) to **7** (very natural).

There are no right or wrong answers.
'''
practice = "# Practice\\n\\nA few clips to get used to the keys. These answers are not part of the study."
block_break = "# Time for a break\\n\\nRest your eyes for as long as you like before you go on."
debrief = "# Thank you\\n\\nBlinks close faster than they open. This study asks which details people notice."

[texts.de]
consent = "# Wie natürlich wirkt dieses Blinzeln?\\n\\nDie Teilnahme ist freiwillig."
instructions = "# Ihre Aufgabe\\n\\nStarten Sie einen Film mit der **Leertaste**, dann bewerten Sie ihn."
practice = "# Übung\\n\\nDiese Antworten zählen nicht."
block_break = "# Zeit für eine Pause"
debrief = "# Vielen Dank"
"""


def without(text: str, *changes: tuple[str, str]) -> str:
    """The declaration with parts replaced; each must be there."""
    for old, new in changes:
        if old not in text:
            raise ValueError(f"expected {old!r} in the declaration, found none")
        text = text.replace(old, new)
    return text


PLAIN = without(
    STUDY,
    ("viewing_distance = true", "viewing_distance = false"),
    ('calibrate = "required"', 'calibrate = "off"'),
    ("per_block = 1", "per_block = 0"),
    ("break_seconds_min = 1", "break_seconds_min = 0"),
)
"""Without the screens that measure the screen: consent, forms, trials."""
ARABIC = (
    PLAIN.replace('languages = ["en", "de"]', 'languages = ["ar"]')
    .replace("[texts.en]", "[texts.ar]")
    .replace("{ en = ", "{ ar = ")
)
"""Run from right to left; the page's words are Arabic, those of the study stay English."""
