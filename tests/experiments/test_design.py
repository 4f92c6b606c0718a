from collections import Counter

import pytest

from experiments import design
from experiments.declaration.rendering import RenderOverrides, RenderSettings
from experiments.kinds import expected_minutes, trials_per_participant
from experiments.load import load_experiment

# design counts of Trutoiu et al. (2011), sections 4.1-4.3
PAPER = {
    "exp1": {"cells": 16, "clips": 320, "trials": 320, "blocks": [160, 160], "minutes": 40},
    "exp2": {"cells": 40, "clips": 200, "trials": 400, "blocks": [100, 100, 100, 100], "minutes": 30},
    "exp3": {"cells": 4, "clips": 80, "trials": 160, "blocks": [80, 80], "minutes": 20},
}


@pytest.mark.parametrize("name", PAPER)
def test_shipped_experiments_have_the_papers_counts(name: str) -> None:
    experiment = load_experiment(name)
    assert len(design.cells(experiment)) == PAPER[name]["cells"]
    assert len(set(design.clips(experiment))) == PAPER[name]["clips"]
    assert trials_per_participant(experiment) == PAPER[name]["trials"]
    assert [len(block.clips) for block in design.blocks(experiment)] == PAPER[name]["blocks"]
    assert expected_minutes(experiment) == pytest.approx(PAPER[name]["minutes"], abs=1)


@pytest.mark.parametrize("name", PAPER)
def test_blocks_show_every_clip_the_declared_number_of_times(name: str) -> None:
    experiment = load_experiment(name)
    shown = Counter(clip for block in design.blocks(experiment) for clip in block.clips)
    assert set(shown) == set(design.clips(experiment))
    assert set(shown.values()) == {experiment.blocks.repeats}


def test_exemplars_are_shared_across_cells_that_do_not_own_them() -> None:
    exp1, exp3 = load_experiment("exp1"), load_experiment("exp3")
    assert len({design.exemplar_key(exp1, clip) for clip in design.clips(exp1)}) == 40  # 20 real, 20 model
    assert len({design.exemplar_key(exp3, clip) for clip in design.clips(exp3)}) == 20


def test_levels_override_the_render_settings() -> None:
    exp2 = load_experiment("exp2")
    spec = next(c for c in design.clips(exp2) if c.cell == "AL_ease/11/cartoon")
    settings = design.render_settings(exp2, spec)
    assert (settings.profile, settings.duration_frames, settings.character) == ("AL_ease", 11, "cartoon")
    assert (settings.amplitude, settings.motion_blur) == ("full", True)


def test_a_level_may_give_its_length_in_other_units() -> None:
    exp2 = load_experiment("exp2")
    of_frames = RenderOverrides(duration_frames=12, duration_frames_fps=60).applied_to(exp2.render)
    of_time = RenderOverrides(duration_ms=200).applied_to(of_frames)
    assert (of_frames.blink_ms, of_time.blink_ms, of_time.duration_frames) == (200, 200, None)
    assert RenderOverrides(duration_frames=6).applied_to(RenderSettings(duration_ms=300)).blink_ms == 200


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"duration_frames": 9, "duration_ms": 300}, "got both; remove one of them"),
        ({"duration_frames": 9, "duration_frames_fps": 240}, "100 to 2000 ms, got duration_frames 9 at 240"),
        ({"duration_frames": 61}, "at 30 fps, 2033 ms"),
    ],
)
def test_a_length_that_cannot_be_is_refused(values: dict[str, float], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        RenderSettings(**values)
