import json
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from stimuli_builder.characters.declaration import write_example_character
from stimuli_builder.clips.preview import SIZE_PX, STEPS, strip, strip_names, write_strips


def test_the_eye_closes_from_the_first_frame_to_the_last() -> None:
    with Image.open(BytesIO(strip("cartoon"))) as picture:
        frames = np.asarray(picture.convert("RGB"), np.float64).reshape(STEPS, SIZE_PX[1], SIZE_PX[0], 3)
    away = np.abs(frames - frames[0]).mean(axis=(1, 2, 3))
    assert np.all(np.diff(away) > -0.2)  # WebP's own noise is far below a step of the lid
    assert away[-1] > 2 * away[4] > 0
    assert len(strip("cartoon")) < 250_000


def test_the_declaration_names_what_was_written(tmp_path: Path) -> None:
    written = write_strips(tmp_path, ["cartoon"])
    declared = json.loads((tmp_path / "strips.json").read_text())
    assert declared["characters"] == ["cartoon"]
    assert (declared["closures"][0], declared["closures"][-1]) == (0.0, 1.0)
    assert written == [("cartoon", (tmp_path / "cartoon.webp").stat().st_size)]


def test_a_character_higher_than_a_strip_gets_none(tmp_path: Path) -> None:
    higher = str(write_example_character(tmp_path / "higher"))
    assert strip_names(["cartoon", higher, "alder@8"]) == ("cartoon", "alder@8")
    assert {"cartoon", "alder@8", "birch@6", "cedar@4", "hazel@7"} <= set(strip_names())
