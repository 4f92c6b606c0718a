"""`stimuli performance`: speech from sound and subtitles, curves for programs, clear refusals."""

import json
import wave
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from blink_engine.speech import Speech, join_speech, speech_events, speech_states
from experiments.declaration.rendering import RenderSettings
from experiments.errors import InputError
from stimuli_builder.blinks.export import AnimationCurve, CurveTarget, write_curve
from stimuli_builder.cli import app
from stimuli_builder.clips.design_clips import performance_curve
from stimuli_builder.performance.run import (
    GazeTrack,
    PerformanceJob,
    gaze_shifts,
    speech_in_audio,
    speech_in_subtitles,
    write_performance,
)

RATE_HZ = 16_000
SUBTITLES = """WEBVTT

00:00:06.000 --> 00:00:08.000
<v Bob>And then?

00:00:01.000 --> 00:00:02.500
<v Anna>Well.

00:00:02.900 --> 00:00:05.000
<v Anna>It was late.
"""


def speech_like(*spoken: tuple[float, float], length_s: float) -> np.ndarray:
    """Vowel-like sound (harmonics of 120 Hz, two formants, syllables at 5 Hz), elsewhere faint noise."""
    rng = np.random.default_rng(1)
    time = np.arange(int(length_s * RATE_HZ)) / RATE_HZ
    voice = sum(
        np.sin(2 * np.pi * 120 * k * time)
        * (np.exp(-(((120 * k - 650) / 300) ** 2)) + 0.4 * np.exp(-(((120 * k - 1200) / 400) ** 2)))
        for k in range(1, 30)
    )
    envelope = np.zeros_like(time)
    for start_s, end_s in spoken:
        envelope[(time >= start_s) & (time < end_s)] = 1
    sound = voice * envelope * (0.6 + 0.4 * np.sin(2 * np.pi * 5 * time)) * 3000 + rng.normal(
        0, 15, time.size
    )
    return np.clip(sound, -32768, 32767).astype(np.int16)


def write_wave(path: Path, samples: np.ndarray, rate_hz: int = RATE_HZ) -> Path:
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate_hz)
        file.writeframes(samples.tobytes())
    return path


def test_speech_is_heard_where_it_is(tmp_path: Path) -> None:
    path = write_wave(tmp_path / "speech.wav", speech_like((1.0, 3.0), (3.6, 5.0), (8.0, 9.5), length_s=11))
    stretches, length_s = speech_in_audio(path)
    assert length_s == pytest.approx(11.0, abs=0.01)
    np.testing.assert_allclose(
        [(one.start_s, one.end_s) for one in stretches], [(1.0, 3.0), (3.6, 5.0), (8.0, 9.5)], atol=0.25
    )


def test_two_speakers_of_one_dialogue_do_not_blink_alike(tmp_path: Path) -> None:
    (tmp_path / "dialogue.vtt").write_text(SUBTITLES, encoding="utf-8")
    curves = {}
    for speaker in ("Anna", "Bob"):
        out = tmp_path / f"{speaker}.json"
        job = PerformanceJob(out, tmp_path / "dialogue.vtt", "json", speaker=speaker, duration_s=120)
        write_performance(job)
        curves[speaker] = np.array(json.loads(out.read_text())["closure_left"])
    starts = [set(np.flatnonzero((one[1:] > 0) & (one[:-1] == 0)).tolist()) for one in curves.values()]
    shapes = [np.unique(np.round(one, 4)) for one in curves.values()]
    assert len(starts[0] & starts[1]) < 0.3 * min(map(len, starts))
    assert len(np.intersect1d(*shapes)) < 0.3 * min(map(len, shapes))


def test_subtitles_of_several_voices_need_a_name(tmp_path: Path) -> None:
    path = tmp_path / "dialogue.vtt"
    path.write_text(SUBTITLES, encoding="utf-8")
    with pytest.raises(InputError, match=r"2 voices \(Anna, Bob\).*--speaker Anna.*dialogue.vtt#Anna"):
        speech_in_subtitles(path)
    one_voice = SUBTITLES.replace("<v Bob>", "<v Anna>")
    path.write_text(one_voice, encoding="utf-8")
    assert len(speech_in_subtitles(path)[0]) == 3
    path.write_text(SUBTITLES.replace("<v Bob>", "").replace("<v Anna>", ""), encoding="utf-8")
    assert len(speech_in_subtitles(path)[0]) == 3


def test_clips_of_two_speakers_name_their_voice(tmp_path: Path) -> None:
    (tmp_path / "dialogue.vtt").write_text(SUBTITLES, encoding="utf-8")
    settings = {"performance": "events", "seconds": 7, "character": "cartoon"}
    anna, bob = (
        performance_curve(
            RenderSettings.model_validate(settings | {"speech": f"dialogue.vtt#{voice}"}),
            "family",
            1,
            5,
            tmp_path,
        )
        for voice in ("Anna", "Bob")
    )
    assert anna.blinks_s != bob.blinks_s
    with pytest.raises(InputError, match="2 voices"):
        performance_curve(
            RenderSettings.model_validate(settings | {"speech": "dialogue.vtt"}), "f", 1, 5, tmp_path
        )


def test_silence_has_no_speech_and_the_blinks_of_the_state(tmp_path: Path) -> None:
    path = write_wave(tmp_path / "silence.wav", np.zeros(RATE_HZ * 60, dtype=np.int16))
    out = tmp_path / "out.json"
    done = CliRunner().invoke(app, ["performance", str(path), "--out", str(out), "--format", "json"])
    assert done.exit_code == 0, done.output
    assert "there is no speech" in " ".join(done.output.split())
    assert len(json.loads(out.read_text())["closure_left"]) == 3600


def test_subtitles_out_of_order_and_by_voice(tmp_path: Path) -> None:
    path = tmp_path / "dialogue.vtt"
    path.write_text(SUBTITLES, encoding="utf-8")
    anna, length_s = speech_in_subtitles(path, "Anna")
    assert (anna, length_s) == ([Speech(1.0, 2.5), Speech(2.9, 5.0)], 8.0)
    with pytest.raises(InputError, match=r"there is no speaker 'Ana'.*Anna.*voices: Anna, Bob"):
        speech_in_subtitles(path, "Ana")


def test_what_the_engine_receives() -> None:
    stretches = join_speech([Speech(3.0, 4.0), Speech(1.0, 2.0), Speech(2.05, 2.4), Speech(7.0, 8.0)])
    assert stretches == [Speech(1.0, 2.4), Speech(3.0, 4.0), Speech(7.0, 8.0)]
    assert [(event.kind, event.time_s) for event in speech_events(stretches)] == [
        ("utterance_start", 1.0),
        ("utterance_end", 2.4),
        ("utterance_start", 3.0),
        ("turn_end", 4.0),
        ("utterance_start", 7.0),
        ("turn_end", 8.0),
    ]
    states = [(change.state, change.time_s) for change in speech_states(stretches)]
    assert states == [
        ("listening", 0.0),
        ("speaking", 1.0),
        ("listening", 4.0),
        ("speaking", 7.0),
        ("listening", 8.0),
    ]


def test_blinks_gather_at_turn_ends(tmp_path: Path) -> None:
    lines = ["WEBVTT", ""]
    for k in range(100):
        lines += [
            f"{k // 10:02d}:{k % 10 * 6:02d}.000 --> {k // 10:02d}:{k % 10 * 6 + 3:02d}.000",
            "words",
            "",
        ]
    path, out = tmp_path / "talk.vtt", tmp_path / "talk.json"
    path.write_text("\n".join(lines), encoding="utf-8")
    write_performance(PerformanceJob(out, path, "json", fps=30))
    names = [blink["profile_id"] for blink in json.loads(out.read_text())["blinks"]]
    assert 50 < names.count("turn_end") <= 100


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["nothing.wav"], "no such file"),
        ([], "expected a recording, subtitles, or --duration"),
        (["--duration", "5", "--fps", "0"], "expected --fps from 1 to 1000"),
        (["--duration", "5", "--state", "readin"], "did you mean 'reading'"),
        (["--duration", "5", "--format", "fbx"], "unknown --format 'fbx'"),
        (["--duration", "5", "--rate", "0"], "expected --rate"),
        (["--duration", "86400", "--fps", "1000"], "expected at most 6000000 frames, got 86400000"),
        (["--duration", "5", "--left", "a", "--right", "a"], "each eye needs a separate shape"),
    ],
)
def test_bad_input_is_one_line(tmp_path: Path, arguments: list[str], told: str) -> None:
    out = tmp_path / "out.csv"
    done = CliRunner().invoke(app, ["performance", *arguments, "--out", str(out)])
    assert isinstance(done.exception, InputError)
    assert told in str(done.exception)
    assert not out.exists()


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"1\n00:00:01,000 --> 00:00:05,000\nGr\xfc\xdfe\n", "save them as UTF-8"),
        (b"1\n00:00:xx --> 00:00:05,000\nhello\n", "expected subtitles with times, found none"),
        (
            b"1\n00:00:06,000 --> 00:00:05,000\nhello\n",
            "a subtitle ends at 00:00:05.000, before or at its start",
        ),
        (b"", "expected subtitles"),
    ],
)
def test_subtitles_that_cannot_be_read_are_refused(tmp_path: Path, content: bytes, told: str) -> None:
    path = tmp_path / "talk.srt"
    path.write_bytes(content)
    with pytest.raises(InputError, match=told):
        speech_in_subtitles(path)


def test_a_file_without_sound_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "text.wav"
    path.write_text("no sound")
    with pytest.raises(InputError, match="expected sound that can be read"):
        speech_in_audio(path)
    empty = write_wave(tmp_path / "empty.wav", np.zeros(0, dtype=np.int16))
    with pytest.raises(InputError, match="expected sound"):
        speech_in_audio(empty)
    table = tmp_path / "empty.csv"
    table.touch()
    with pytest.raises(InputError, match=r"or subtitles \(\.vtt, \.srt\): [^\[]+$"):
        speech_in_audio(table)


def _blinks(folder: Path, *arguments: str) -> dict[str, list[float]]:
    out = folder / "out.json"
    done = CliRunner().invoke(app, ["performance", "--out", str(out), "--format", "json", *arguments])
    assert done.exit_code == 0, done.output
    curves: dict[str, list[float]] = json.loads(out.read_text(encoding="utf-8"))
    return curves


def _onsets_in(closure: list[float], fps: float) -> np.ndarray:
    """Times at which the eye begins to close, from the curve alone."""
    moved = np.asarray(closure) > min(closure) + 1e-6
    return np.flatnonzero(moved[1:] & ~moved[:-1]) / fps


def test_given_blinks_come_when_they_are_given_and_no_others(tmp_path: Path) -> None:
    (tmp_path / "given.csv").write_text("time_s\n7.5\n2\n14.25\n", encoding="utf-8")
    options = ["--blinks-at", str(tmp_path / "given.csv"), "--duration", "20", "--fps", "100"]
    curves = _blinks(tmp_path, *options, "--complete", "1")
    eyes = [curves[name] for name in ("closure_left", "closure_right")]
    # an eye may follow the other by a few hundredths of a second
    first = np.minimum(*(_onsets_in(eye, 100) for eye in eyes))
    assert first == pytest.approx([2, 7.5, 14.25], abs=0.03)
    assert [max(eye) for eye in eyes] == pytest.approx([1, 1], abs=0.01)


def test_lively_eyes_blink_four_times_as_often_as_calm_ones(tmp_path: Path) -> None:
    hour = ("--duration", "3600", "--fps", "50", "--lively")
    curves = [_blinks(tmp_path, *hour, text)["closure_left"] for text in ("0", "0.5", "1")]
    counts = [len(_onsets_in(curve, 50)) for curve in curves]
    assert counts[0] < counts[1] < counts[2]
    assert counts[2] / counts[0] == pytest.approx(4, rel=0.35)


def _gaze_file(path: Path) -> Path:
    """Ten shifts of 40 degrees to the right or back, every 2 s; from 20 s a slow look down by 30 degrees."""
    times = np.arange(0, 30, 0.01)
    right = np.zeros(times.size)
    for number, begin in enumerate(np.arange(1, 20, 2)):
        right += (1 if number % 2 == 0 else -1) * 40 * np.clip((times - begin) / 0.1, 0, 1)
    up = -30 * np.clip((times - 20) / 2, 0, 1)
    lines = [f"{t:.2f},{x:g},{y:g}" for t, x, y in zip(times, right, up, strict=True)]
    path.write_text("\n".join(["time_s,right_deg,up_deg", *lines, ""]), encoding="utf-8")
    return path


def test_lids_follow_a_gaze_whose_large_shifts_bring_blinks(tmp_path: Path) -> None:
    options = ["--gaze", str(_gaze_file(tmp_path / "gaze.csv")), "--duration", "30", "--fps", "100"]
    calm = ["--rate", "0.1", "--complete", "1"]
    curves = _blinks(tmp_path, *options, *calm)
    assert curves["gaze_right_deg"][200] == pytest.approx(40)
    first = np.minimum(*(_onsets_in(curves[f"closure_{eye}"], 100) for eye in ("left", "right")))
    # Evinger et al. (1994): 97% of shifts above 33 degrees; each blink begins with its shift.
    shifts = np.arange(1, 20, 2)
    answered = [bool((np.abs(first - shift) < 0.1).any()) for shift in shifts]
    assert sum(answered) >= 8
    assert curves["closure_left"][-1] == pytest.approx(0.016 * 30, abs=0.01)
    looks = tmp_path / "looks.csv"
    done = CliRunner().invoke(app, ["performance", "--out", str(looks), "--format", "arkit", *options, *calm])
    assert done.exit_code == 0, done.output
    shapes = np.genfromtxt(looks, delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert shapes["EyeLookOutRight"][150] == shapes["EyeLookInLeft"][150] == 1
    assert shapes["EyeLookInRight"][150] == shapes["EyeLookUpLeft"][150] == 0
    assert shapes["EyeLookDownRight"][-1] == pytest.approx(30 / 35, abs=1e-4)


@pytest.mark.parametrize(
    "text",
    [
        "time_s,flag\n0,0\n5,1\n12.5,0\n15,down\n18,Up\n",
        "time_s,flag\n0,0.0\n5,1.0\n12.5,0.0\n18,1.0\n",
        "start_s,end_s\n18,40\n5,9\n8,12.5\n",
    ],
)
def test_blinks_come_while_the_flag_is_down(tmp_path: Path, text: str) -> None:
    (tmp_path / "flag.csv").write_text(text, encoding="utf-8")
    options = ["--duration", "20", "--fps", "100", "--rate", "60", "--seed", "3"]
    free = _blinks(tmp_path, *options)
    curves = _blinks(tmp_path, *options, "--blink-while-down", str(tmp_path / "flag.csv"))
    up = np.r_[500:1251, 1800:2000]
    for name in ("closure_left", "closure_right"):
        held, unheld = np.array(curves[name]), np.array(free[name])
        assert (held[up] == 0).all()
        assert unheld[up].max() > 0.5
        # Before the flag goes up for the first time, nothing differs.
        np.testing.assert_array_equal(held[:400], unheld[:400])
        assert held[1251:1300].max() > 0.3


def test_spans_of_a_flag_that_overlap_are_counted_once(tmp_path: Path) -> None:
    (tmp_path / "flag.csv").write_text("start_s,end_s\n5,9\n-1,6\n5,9\n", encoding="utf-8")
    arguments = ["performance", "--blink-while-down", str(tmp_path / "flag.csv"), "--duration", "20"]
    done = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path / "out.csv")])
    assert done.exit_code == 0, done.output
    assert "the flag is up for 9.0 s" in done.output


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (
            "time_s,up\n1,1\n",
            [],
            "expected the columns time_s and flag, or start_s and end_s, got time_s, up",
        ),
        ("time_s,flag\n1,maybe\n", [], "flag: expected 0 (down) or 1 (up), got 'maybe'"),
        ("time_s,flag\nsoon,1\n", [], "expected seconds"),
        ("time_s,flag\n2,1\n1,0\n", [], "expected rising times"),
        ("time_s,flag\n1,1\nnan,0\n", [], "expected rising times"),
        ("start_s,end_s\n3,2\n", [], "expected each end_s after its start_s"),
        ("start_s,end_s\n30,40\n", [], "expected times from 0 to 10 s"),
        ("start_s,end_s\n", [], "expected one row or more under the header"),
        ("time_s,flag\n1,1\n", ["--blinks-at", "given.csv"], "remove --blink-while-down"),
    ],
)
def test_a_flag_that_cannot_be_is_one_line(tmp_path: Path, text: str, options: list[str], said: str) -> None:
    (tmp_path / "flag.csv").write_text(text, encoding="utf-8")
    out = tmp_path / "out.csv"
    arguments = ["performance", "--blink-while-down", str(tmp_path / "flag.csv"), "--duration", "10"]
    done = CliRunner().invoke(app, [*arguments, "--out", str(out), *options])
    assert isinstance(done.exception, InputError)
    assert said in str(done.exception)
    assert not out.exists()


@pytest.mark.parametrize(("noise_deg", "rate_hz"), [(0.1, 500), (0.3, 250), (0.3, 500)])
def test_noise_of_an_eye_tracker_is_no_gaze_shift(noise_deg: float, rate_hz: int) -> None:
    random = np.random.default_rng(1)
    times = np.arange(0, 60, 1 / rate_hz)
    resting = noise_deg * random.normal(size=(times.size, 2))
    assert gaze_shifts(GazeTrack(times, resting)) == []
    shifted = resting + np.outer(np.clip((times - 30) / 0.06, 0, 1), [20.0, 0.0])
    [shift] = gaze_shifts(GazeTrack(times, shifted))
    assert shift.time_s == pytest.approx(30, abs=0.03)
    assert shift.amplitude_deg == pytest.approx(20, abs=1.5)


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        ("time_s,x\n1,2\n", [], "expected the columns time_s, right_deg and up_deg, got time_s, x"),
        ("time_s,up_deg\n1,high\n", [], "expected numbers"),
        ("time_s,up_deg\n2,1\n1,1\n", [], "expected rising times"),
        ("time_s,up_deg\n0,1\n1,90\n", [], "expected angles up to 60 degrees"),
        ("time_s,up_deg\n99,1\n", [], "expected times from 0 to 10 s"),
        ("time_s,up_deg\n1,1\n", ["--blinks-at", "given.csv"], "remove one of them"),
    ],
)
def test_a_gaze_that_cannot_be_is_one_line(tmp_path: Path, text: str, options: list[str], said: str) -> None:
    (tmp_path / "gaze.csv").write_text(text, encoding="utf-8")
    out = tmp_path / "out.csv"
    arguments = ["performance", "--gaze", str(tmp_path / "gaze.csv"), "--duration", "10", "--out", str(out)]
    done = CliRunner().invoke(app, [*arguments, *options])
    assert isinstance(done.exception, InputError)
    assert said in str(done.exception)
    assert not out.exists()


@pytest.mark.parametrize(("name", "opened"), [("liveportrait", 0.3), ("ditto", 0.9)])
def test_eye_ratios_are_read_by_numpy(tmp_path: Path, name: str, opened: float) -> None:
    curve = AnimationCurve(25, *np.array([[0, 0.5, 1], [0, 0, 1], [0, 0, 0], [0, 0, 0]]), ())
    (tmp_path / "eyes.csv").write_text(write_curve(name, curve, CurveTarget()), encoding="utf-8")
    ratios = np.loadtxt(tmp_path / "eyes.csv", delimiter=",")
    # the person's left eye, half closed in the second frame, is on the right of the picture
    assert ratios == pytest.approx(np.array([[1, 1], [1, 0.5], [0, 0]]) * opened)


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        ("seconds\n1\n", [], "expected a column time_s or onset_s, got seconds"),
        ("time_s\nsoon\n", [], "time_s: expected seconds"),
        ("time_s\n99\n", [], "expected times from 0 to 10 s"),
        ("time_s\n1\nnan\n3\n", [], "expected times from 0 to 10 s"),
        ("time_s\n1\n3\n3.05\n", [], "s between blinks, got 3 and 3.05 s"),
        ("time_s\n1\n", ["--rate", "20"], "remove --rate and --lively"),
        ("time_s\n1\n", ["--complete", "2"], "expected --complete from 0 to 1, got 2"),
    ],
)
def test_given_blinks_that_cannot_be_are_one_line(
    tmp_path: Path, text: str, options: list[str], said: str
) -> None:
    (tmp_path / "given.csv").write_text(text, encoding="utf-8")
    out = tmp_path / "out.csv"
    arguments = ["performance", "--blinks-at", str(tmp_path / "given.csv"), "--duration", "10"]
    done = CliRunner().invoke(app, [*arguments, "--out", str(out), *options])
    assert isinstance(done.exception, InputError)
    assert said in str(done.exception)
    assert not out.exists()
