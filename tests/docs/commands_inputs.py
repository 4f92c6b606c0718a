"""Files and visits that the documentation's pages speak of, for `test_commands_run.py`."""

import csv
import itertools
import random
import wave
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from docx import Document
from fastapi.testclient import TestClient
from openpyxl import Workbook

from experiments.load import load_experiment, locate
from server.app import create_app
from server.core.settings import Settings
from server.models import Link, Study
from stimuli_builder.characters.declaration import write_example_character
from stimuli_builder.tracking.labels import Labels, save_labels
from stimuli_builder.tracking.shapes import default_markers
from tests.helpers.studies import FROM_OWN_PAGE, Participant, link_token
from tests.helpers.tiny_clips import make_clip_folder
from tests.helpers.videos import write_video
from tests.stimuli_builder.characters.recordings import Recording
from tests.stimuli_builder.sync_patch.films import Camera, film, steady
from tests.stimuli_builder.sync_patch.test_photodiode import write_trace

LIDS = """
name = "lids"
title = "How natural are these blinks?"

[[factors]]
name = "speed"
label = "Speed"
between = true
levels = [{ name = "slow", label = "Slow" }, { name = "fast", label = "Fast" }]

[[factors]]
name = "face"
label = "Face"
levels = [{ name = "cartoon", label = "Cartoon" }, { name = "alder", label = "Photorealistic" }]

[exemplars]
per_cell = 2

[display]
calibrate = "off"

[trial.scale]
question = { en = "How natural was this blink?" }
low = { en = "not natural" }
high = { en = "very natural" }

[texts.en]
consent = "# Blinks\\n\\nTaking part is voluntary. A few short clips show flickering dots.\\n"
instructions = "# What to do\\n\\nStart each clip with Space, watch it, then answer.\\n"
debrief = "# Thank you\\n\\nYour answers are stored.\\n"
"""
PARTICIPANTS = [f"p{number:02d}" for number in range(1, 17)]


def write_inputs(folder: Path) -> None:
    """Everything that takes no time: tables, declarations, tiny clips, sound and text."""
    _write_tables(folder, random.Random(51))
    _write_sound(folder / "speech.wav")
    (folder / "dialogue.vtt").write_text(
        "WEBVTT\n\n00:00.500 --> 00:02.000\n<v Anna>Did you see?\n\n00:02.500 --> 00:04.000\n<v Ben>No.\n"
    )
    (folder / "flag.csv").write_text("time_s,flag\n5,1\n9.5,0\n")
    (folder / "gaze.csv").write_text("time_s,right_deg,up_deg\n0,0,0\n4.9,0,0\n5,30,0\n12,30,-20\n")
    (folder / "onsets.csv").write_text("time_s\n2.5\n8\n14.2\n")
    (folder / "lids.toml").write_text(LIDS)
    manuscript = Document()
    manuscript.add_paragraph(
        "Faces differed, F(1, 23) = 5.92, p = .023, and blinks did not, t(23) = 0.50, p = .62."
    )
    manuscript.save(str(folder / "manuscript.docx"))
    (folder / "mine.toml").write_text(locate("exp1").read_text(encoding="utf-8"))
    make_clip_folder(load_experiment(str(folder / "lids.toml")), folder / "my-clips")
    make_clip_folder(load_experiment("exp3"), folder / "out" / "exp3")
    (folder / "recordings").mkdir()
    for speed, shape in itertools.product(("slow", "medium", "fast"), ("disc", "square")):
        write_video(folder / "recordings" / f"{speed}_{shape}.mp4")
    write_trace(folder / "diode.csv", steady(11, 30.0))
    write_example_character(folder / "robot")


# Visits, and videos that take a while.


ABOUT = {"demographics": {"age": 30, "vision": "normal"}}
"""Answers to the forms of exp3; `lids` has none."""


def take_part(folder: Path, study: str, people: int, *, recruiter_id: str = "", answers: bool = True) -> None:
    """Visits of people in a folder's data, complete ones with `answers`; `recruiter_id` is the first's."""
    app = create_app(Settings(data_folder=folder / "data"))
    with TestClient(app, headers=FROM_OWN_PAGE) as client:
        services = app.state.services
        with services.database.read() as session:
            link = session.query(Link).join(Study).filter(Study.name == study, Link.kind == "general").first()
            token = link_token(services, link)
        for number, identifier in enumerate([recruiter_id, *[""] * (people - 1)]):
            person = Participant(client, token)
            started = person.start(query={"participant": identifier} if identifier else {})
            assert started.status_code == 201, started.text
            assert person.request("PUT", "/consent", {"agreed": True}).status_code == 200
            if answers:
                _answer_all(person, ABOUT if study == "exp3" else {}, random.Random(number))


def _answer_all(person: Participant, forms: Mapping[str, object], draw: random.Random) -> None:
    for form, given in forms.items():
        assert person.request("PUT", f"/forms/{form}", {"answers": given}).status_code == 200
    for trial in person.state()["trials"]:
        assert person.rate(trial, draw.randint(1, 7)).status_code == 201
    done = person.request("POST", "/complete")
    assert done.status_code == 200, done.text


def write_person(folder: Path) -> None:
    """A generated face that blinks, and labels of its landmarks: face.mp4, face.labels.json."""
    person = Recording(fps=100.0, seconds=5.0, width_px=640, onsets=(0.3, 1.3, 2.3, 3.3, 4.2))
    person.write(folder, "face")
    frames = {frame: person.points(frame) for frame in range(0, person.frame_count, 20)}
    labels = Labels(folder / "face.labels.json", person.size_px, default_markers(2), frames)
    save_labels(labels, "face.mp4", "generated")


def write_recording_with_track(folder: Path) -> None:
    """A generated recording in slow motion, and its exact track: me.mp4, me.csv."""
    Recording().write(folder, "me")


def write_filmed_screen(folder: Path) -> None:
    """A clip of 60 frames as a phone films it: slow_motion.mov."""
    film(folder / "slow_motion.mov", steady(60, 30.0), Camera(), 2400.0)


# Tables, declarations and sound.


def _write_tables(folder: Path, draw: random.Random) -> None:
    ratings = []
    for number, person in enumerate(PARTICIPANTS):
        own, age, group = draw.gauss(0, 0.6), 20 + draw.randrange(30), "ab"[number % 2]
        for face, blur, take, scale in itertools.product(
            ("ada", "bea", "cleo"), ("on", "off"), (1, 2), ("alive", "natural")
        ):
            score = 4 + own + (face == "ada") * 0.8 + (blur == "on") * 0.4 + draw.gauss(0, 0.8)
            clip = f"{face}_{blur}_{take}"
            ratings.append({
                "id": person, "participant": person, "group": group, "age": age, "face": face, "blur": blur,
                "phase": "before" if take == 1 else "after", "clip": clip, "stimulus": clip, "scale": scale,
                "score": round(min(7.0, max(1.0, score))), "response": round(min(7.0, max(1.0, score))),
            })  # fmt: skip
    _write_csv(folder / "ratings.csv", ratings)
    _write_csv(folder / "table.csv", ratings)
    _write_csv(folder / "comparisons.csv", _comparisons(draw))
    _write_csv(folder / "trials.csv", _trials(draw))
    _write_csv(folder / "votes.csv", _votes(draw))
    coders = itertools.product(range(100, 900, 40), ("anna", "ben"))
    _write_csv(
        folder / "coders.csv",
        [
            {"blink": blink, "coder": coder, "accepted": int(draw.random() < 0.9 if blink % 3 else 0)}
            for blink, coder in coders
        ],
    )
    answers = []
    for person in PARTICIPANTS:
        level = draw.gauss(4, 1)
        answers.append({
            "participant": person, **{f"q{item}": round(level + draw.gauss(0, 0.7)) for item in range(1, 6)}
        })  # fmt: skip
    _write_csv(folder / "items.csv", answers)
    wide = Workbook()
    wide.active.append(["id", "ada_on", "ada_off", "bea_on", "bea_off"])
    for person in PARTICIPANTS:
        wide.active.append([person, *(draw.randint(1, 7) for _ in range(4))])
    wide.save(folder / "wide.xlsx")
    times = "".join(
        f"p{person},{person % 7 + 1},{person * 3 % 7 + 1},{person * 5 % 7 + 1}\n" for person in range(12)
    )
    (folder / "times.csv").write_text(f"id,t1,t2,t3\n{times}")
    speeds = "".join(
        f"p{person},{20 + person},{person % 7 + 1},{person * 3 % 7 + 1}\n" for person in range(12)
    )
    (folder / "speeds.csv").write_text(f"id,age,slow,fast\n{speeds}")
    # Eyes open 0.3 of their width, blinking every 3 s for 200 ms, at 240 frames per second.
    time_s = np.arange(0, 30, 1 / 240)
    closure = np.clip(1 - np.abs((time_s % 3) - 1.5) / 0.1, 0, 1) ** 0.7
    noise = np.random.default_rng(51).normal(0, 0.002, (2, len(time_s)))
    columns = 0.3 * (1 - 0.9 * closure) + noise
    names = ("EAR_l", "EAR_r", "EAR_left", "EAR_right")
    _write_csv(
        folder / "series.csv",
        [
            {name: round(float(columns[index % 2][frame]), 5) for index, name in enumerate(names)}
            for frame in range(len(time_s))
        ],
    )


def _comparisons(draw: random.Random) -> list[dict[str, object]]:
    ability = {"ours": 0.6, "baseline": 0.0, "recorded": 1.0, "reference": 1.4}
    rows = []
    for person, scene, asked, (left, right) in itertools.product(
        PARTICIPANTS, ("street", "room"), ("alive", "sharp"), itertools.combinations(ability, 2)
    ):
        chance = 1 / (1 + np.exp(ability[right] - ability[left]))
        winner = "left" if draw.random() < chance else "right"
        rows.append({
            "participant": person, "id": person, "observer": person, "scene": scene, "asked": asked,
            "left": left, "right": right, "winner": winner,
        })  # fmt: skip
    return rows


def _trials(draw: random.Random) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for person, speed, duration in itertools.product(PARTICIPANTS, ("slow", "fast"), range(80, 321, 40)):
        seen = draw.random() < 1 / (1 + np.exp(-(duration - (180 if speed == "slow" else 220)) / 25))
        rows.append({"id": person, "speed": speed, "duration": duration, "seen": int(seen)})
    return rows


def _votes(draw: random.Random) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for person, scene, (system, mean) in itertools.product(
        PARTICIPANTS, ("street", "room"), {"source": 4.6, "low": 2.2, "middle": 3.1, "high": 4.0}.items()
    ):
        vote = round(min(5.0, max(1.0, draw.gauss(mean, 0.7))))
        rows.append({
            "participant": person, "stimulus": f"{scene}_{system}", "response": vote,
            "source": f"{scene}_source",
        })  # fmt: skip
    return rows


def _write_csv(path: Path, rows: Sequence[Mapping[str, object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def _write_sound(path: Path) -> None:
    """Four seconds: speech-like noise, a pause, and again."""
    noise = np.random.default_rng(51).normal(0, 4000, 4 * 16000)
    noise[24000:40000] = 0
    with wave.open(str(path), "wb") as sound:
        sound.setparams((1, 2, 16000, len(noise), "NONE", "not compressed"))
        sound.writeframes(noise.astype("<i2").tobytes())
