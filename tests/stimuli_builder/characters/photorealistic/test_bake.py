"""Planning, resuming and assembling a bake; the renderer itself where Blender is installed."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.characters.atlas import load_atlas
from stimuli_builder.characters.photorealistic.assembly import Assembly
from stimuli_builder.characters.photorealistic.bake import BakeOrder, bake
from stimuli_builder.characters.photorealistic.development import develop, psnr_db
from stimuli_builder.characters.photorealistic.eyelid_skin import LidPose
from stimuli_builder.characters.photorealistic.framing import Frame, bounding_box, parse_size
from stimuli_builder.characters.photorealistic.inbetween import Inbetweener, Rendered, flow_mix
from stimuli_builder.characters.photorealistic.parameters import PRESETS_FILE, load_preset, load_presets
from stimuli_builder.characters.photorealistic.plan import HORIZONTAL_MM, Quality, closures_of, stages
from stimuli_builder.characters.photorealistic.renderer import Renderer, Shot

SMALL = Frame(240, 200)
QUALITY = Quality(1, 1)
BLENDER = Path(__file__).parents[4] / ".venv-bake" / "bin" / "python"


def order(tmp_path: Path, levels: int = 3, rendered: int = 3) -> BakeOrder:
    face = load_preset("northern")
    return BakeOrder(
        "northern", face, SMALL, levels, rendered, QUALITY, tmp_path / "out", tmp_path / "work", tmp_path, 1
    )


def pretend_rendered(wanted: BakeOrder) -> None:
    """Put flat grey shots where a finished bake would have left its renders."""
    for stage in stages(wanted.work_folder(), SMALL, QUALITY, wanted.rendered):
        for shot in stage.shots:
            shot.file.parent.mkdir(parents=True, exist_ok=True)
            grey = 0.3 - 0.1 * shot.pose.closure
            np.savez(
                shot.file, **{k: np.full((b[3], b[2], 3), grey, np.float16) for k, b in shot.boxes.items()}
            )


def test_generations_bisect_and_render_each_level_once(tmp_path: Path) -> None:
    plan = stages(tmp_path, Frame(960, 360), QUALITY, 17)
    levels = [s.pose.closure for stage in plan for s in stage.shots if s.file.name.startswith("level")]
    assert levels[:5] == [0.0, 1.0, 0.5, 0.25, 0.75]
    assert sorted(levels) == closures_of(17)
    assert [stage.levels for stage in plan] == [2, 3, 5, 9, 9, 17]
    assert [stage.lower_lid for stage in plan] == [False, False, False, False, True, True]


@pytest.mark.parametrize("levels", [0, 1, 4, 100, 128])
def test_levels_that_do_not_bisect_are_refused(levels: int) -> None:
    with pytest.raises(InputError, match="levels must be one of"):
        closures_of(levels)


@pytest.mark.slow
def test_finished_shots_become_an_atlas_without_rendering(tmp_path: Path) -> None:
    wanted = order(tmp_path)
    pretend_rendered(wanted)
    calls: list[tuple[int, int]] = []
    bake(wanted, lambda done, total, _: calls.append((done, total)))
    assert calls == [(36, 36)]
    character = load_atlas(wanted.out)
    character.check_files()
    assert list(character.closures) == [0.0, 0.5, 1.0]
    assert character.lower_lid_layer.vertical_mm.tolist() == [0, 0.25, 0.5, 0.75, 1]
    assert character.lower_lid_layer.horizontal_mm.tolist() == list(HORIZONTAL_MM)
    np.testing.assert_array_equal(character.base_linear()[character.crop], character.levels_linear()[0])
    assert character.declaration.provenance["samples"] == 1
    rim = character.levels_linear()[:, 0]
    np.testing.assert_array_equal(rim[0], rim[2])


def test_bake_without_blender_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr("sys.executable", str(tmp_path / "python"))  # no uv beside it either
    with pytest.raises(InputError, match="uv is not on the PATH"):
        bake(order(tmp_path), lambda *_: None)


@pytest.mark.parametrize("text", ["960", "960x", "0x0", "axb", "96x36", "960x210"])
def test_sizes_that_cannot_be_rendered_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="size"):
        parse_size(text)


@pytest.mark.parametrize("size", ["960x360", "1920x720", "480x180"])
def test_boxes_lie_inside_the_frame_and_fade_to_nothing(size: str) -> None:
    width, height = map(int, size.split("x"))
    frame = Frame(width, height)
    x, y, w, h = bounding_box(list(frame.eye_boxes().values()))
    assert x >= 0
    assert y >= 0
    assert x + w <= width
    assert y + h <= height
    for box in frame.eye_boxes().values():
        feather = frame.feather(box)
        assert feather.shape == (box[3], box[2], 1)
        assert not feather[0].any()
        assert not feather[:, -1].any()
        assert feather.max() == 1


def test_development_is_monotonic_and_stays_within_the_picture() -> None:
    light = np.linspace(0, 20, 2000, dtype=np.float32)
    code = develop(light, 0.0)
    assert (np.diff(code) >= 0).all()
    assert code[0] == 0
    assert code[-1] <= 1


def test_in_between_of_equal_levels_is_that_level() -> None:
    frame = Frame(480, 180)
    origin = bounding_box(list(frame.eye_boxes().values()))
    flat = np.full((origin[3], origin[2], 3), 0.25, np.float32)
    ends = [Rendered(LidPose(w), flat) for w in (0.25, 0.75)]
    inbetweener = Inbetweener(load_preset("northern"), frame, frame.eye_boxes(), origin, flat)
    made = inbetweener.mix(LidPose(0.5), *ends, 0.5)
    np.testing.assert_allclose(made, flat, atol=1e-5)


def test_psnr_of_known_pictures() -> None:
    a = np.zeros((4, 4, 3), np.uint8)
    assert psnr_db(a, a) == float("inf")
    assert psnr_db(a, a + np.uint8(255)) == 0.0
    assert psnr_db(a, a + np.uint8(1)) == pytest.approx(48.13, abs=0.01)


def test_both_presets_are_declared() -> None:
    assert set(load_presets()) == {"northern", "southern"}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [("melanin = 1.0", "melanin = 9", "northern.skin.melanin"), ("[northern]", "[northern", "is not TOML")],
)
def test_wrong_preset_is_one_clear_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    file = tmp_path / "presets.toml"
    file.write_text(PRESETS_FILE.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        load_presets(file)


def test_unknown_preset_suggests_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'northern'"):
        load_preset("nothern")


@pytest.mark.slow
@pytest.mark.skipif(not BLENDER.exists(), reason="Blender's environment is not here: made by `stimuli bake`")
def test_rendered_pixels_show_the_calibrated_opening(tmp_path: Path) -> None:
    frame = Frame(960, 360)
    shot = Shot(tmp_path / "mask.npz", LidPose(0.5), frame.eye_boxes(), 4, "eye_mask")
    face = load_preset("northern")
    with Renderer(BLENDER, face, frame, tmp_path, tmp_path / "blender.log", 1) as renderer:
        renderer.render(shot)
    for pixels in shot.read().values():
        opening = pixels[..., 0].astype(float).clip(0, 1).sum(0).max() / frame.px_per_mm
        assert opening == pytest.approx(5.5, abs=0.3)


def test_levels_in_between_are_made_from_rendered_ones(tmp_path: Path) -> None:
    wanted = order(tmp_path, levels=5)
    pretend_rendered(wanted)
    made = list(Assembly(wanted.work_folder(), wanted.face, SMALL, QUALITY).levels(5))
    assert [closure for closure, _ in made] == [0.0, 0.25, 0.5, 0.75, 1.0]
    brightness = [float(picture.mean()) for _, picture in made]
    assert (np.diff(brightness) < 0).all()


def test_flow_carries_a_shifted_picture_half_way() -> None:
    rng = np.random.default_rng(4)
    blobs = cv2.GaussianBlur(rng.random((80, 120, 3), np.float32), (0, 0), 4)
    blobs = (blobs - blobs.min()) / (blobs.max() - blobs.min())
    low, truth, high = blobs, np.roll(blobs, 2, axis=0), np.roll(blobs, 4, axis=0)
    made, faded = flow_mix(low, high, 0.5), (low + high) / 2
    inside = (slice(20, 60), slice(20, 100))
    moved_error = np.abs(made[inside] - truth[inside]).mean()
    assert moved_error < 0.3 * np.abs(faded[inside] - truth[inside]).mean()
