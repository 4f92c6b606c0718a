import tomllib
from pathlib import Path

import pytest

from experiments.errors import InputError
from stimuli_builder.blinks.library import LIBRARY_FOLDER, load_library, read_recordings
from stimuli_builder.blinks.library.build import recorded_profiles, write_model, write_profiles


def test_the_library_ships_eighteen_profiles_of_nine_blinks_and_three_tracked_ones():
    shipped = load_library()
    assert [profile.eye for profile in shipped] == ["left"] * 9 + ["right"] * 9 + [None] * 3
    assert [profile.recording for profile in shipped] == ["espbm"] * 18 + ["eyeloop"] * 3
    assert len({profile.profile_id for profile in shipped}) == len(shipped)


def test_pairs_hold_both_eyes_on_the_same_samples():
    pairs = load_library(paired=True)
    assert len(pairs) == 9
    for pair in pairs:
        assert pair.eye == "both"
        assert pair.closure_other is not None


def test_every_profile_begins_and_ends_open():
    for profile in load_library():
        assert profile.closure[0] == profile.closure[-1] == 0
        assert profile.closure[profile.minimum_index] == pytest.approx(profile.closure.max(), abs=0.01)
        assert 5 < profile.duration_frames_30fps < 20


def test_every_recording_is_declared_with_its_source_and_licence():
    sources = (LIBRARY_FOLDER / "SOURCES.md").read_text(encoding="utf-8")
    for recording in read_recordings():
        assert recording.source in sources
        assert recording.licence in sources
        assert f"`{recording.name}`" in sources
    assert {profile.recording for profile in load_library()} == {entry.name for entry in read_recordings()}


def test_the_library_is_rebuilt_to_the_byte(shared_data, tmp_path):
    entries = read_recordings()
    measured = [p for entry in entries for p in recorded_profiles(entry, shared_data / "blink_series")]
    write_profiles(tmp_path, measured, entries)
    write_model(tmp_path, measured)
    for name in ("profiles.csv", "closures.csv"):
        assert (tmp_path / name).read_bytes() == (LIBRARY_FOLDER / name).read_bytes()


def test_a_recording_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="--data"):
        recorded_profiles(read_recordings()[0], tmp_path)


@pytest.mark.parametrize("content", ["", "[[recording]]\nname = 'x'\n", "x = ", "recording = 3\n"])
def test_a_list_of_recordings_that_is_none_is_refused(tmp_path: Path, content):
    (tmp_path / "r.toml").write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=r"r\.toml"):
        read_recordings(tmp_path / "r.toml")


def test_the_list_of_recordings_is_plain_toml():
    with (LIBRARY_FOLDER / "recordings.toml").open("rb") as stream:
        assert tomllib.load(stream)["recording"][0]["name"] == "espbm"
