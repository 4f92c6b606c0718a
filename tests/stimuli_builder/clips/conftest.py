"""A small experiment on the cartoon and on an own character, built once for all tests."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from experiments.declaration.experiment import Experiment
from experiments.load import load_experiment
from stimuli_builder.characters.declaration import write_example_character
from stimuli_builder.clips.build import Machines, Report, build
from stimuli_builder.clips.design_clips import Options

SMALL = """
name = "small"
title = "Two characters, two profiles"

[[factors]]
name = "character"
label = "Character"
[[factors.levels]]
name = "cartoon"
label = "Cartoon"
render = { character = "cartoon" }
[[factors.levels]]
name = "own"
label = "A folder of one's own"
render = { character = "tiny" }

[[factors]]
name = "profile"
label = "Profile"
[[factors.levels]]
name = "real"
label = "Real"
render = { profile = "real" }
[[factors.levels]]
name = "mine"
label = "From a file"
render = { profile = "mine.csv", duration_frames = 8 }

[exemplars]
per_cell = 2
own_per = ["profile"]

[render]
width_px = 320
height_px = 120

[trial]
kind = "clip_rating"
[trial.scale]
question = { en = "How natural?" }
low = { en = "very unnatural" }
high = { en = "very natural" }

[texts.en]
consent = "c"
instructions = "i"
debrief = "d"
"""
CURVE = [0.0, 0.2, 0.6, 0.9, 1.0, 0.9, 0.7, 0.5, 0.3, 0.2, 0.1, 0.0]


@dataclass(frozen=True)
class Small:
    """The small experiment's folder, its declaration and how it is built."""

    folder: Path
    toml: Path
    experiment: Experiment
    options: Options

    def build(self, out: Path, machines: Machines | None = None) -> Report:
        return build(self.experiment, out, self.options, machines or Machines(workers=1))


def make_small(folder: Path, text: str = SMALL) -> Small:
    folder.mkdir(exist_ok=True)
    write_example_character(folder / "tiny")
    (folder / "mine.csv").write_text("closure\n" + "\n".join(map(str, CURVE)) + "\n")
    toml = folder / "small.toml"
    toml.write_text(text)
    return Small(folder, toml, load_experiment(str(toml)), Options(base_folder=folder))


@pytest.fixture(scope="session")
def small(tmp_path_factory: pytest.TempPathFactory) -> Small:
    return make_small(tmp_path_factory.mktemp("small") / "study")


@pytest.fixture(scope="session")
def built(small: Small, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the small experiment's clips: read it, do not change it."""
    out = tmp_path_factory.mktemp("built") / "clips"
    small.build(out)
    return out


@pytest.fixture(scope="session")
def small_text() -> str:
    return SMALL
