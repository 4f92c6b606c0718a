"""What one experimenter may send to keep a server busy or make it fail: refused in words, at once."""

import re
import time
from typing import Any

import pytest

from server.context import Services
from server.studies.uploads import Quota, new_upload
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, StudyInDatabase

SOON_S = 5.0
"""Milliseconds' work; as a regular expression some of it took minutes.

It is processor time, since other programs may keep a test waiting.
"""


@pytest.mark.parametrize(
    ("toml", "said"),
    [
        ("a" + ".a" * 20_000 + " = 1", "nested too deeply"),
        ("a" + " . 'b'.\"c\"" * 10_000 + " = 1", "nested too deeply"),
        ("[a" + ".a" * 20_000 + "]", "nested too deeply"),
        ("a = " + "[" * 40 + "]" * 40, "nested too deeply"),
        ("a = " + "9" * 5_000, "too many digits"),
    ],
)
def test_a_definition_that_no_program_reads_is_refused_in_words(
    experimenter: Admin, study: StudyInDatabase, toml: str, said: str
) -> None:
    began = time.process_time()
    for path, body in (
        ("/studies/short/versions/check", {"toml": toml}),
        ("/studies", {"name": "other", "shipped": "exp1", "toml": toml}),
        ("/definitions/edit", {"toml": toml, "data": {"title": "t"}}),
    ):
        answer = experimenter.send("POST", path, body)
        assert (answer.status_code, said in answer.json()["error"]["message"]) == (422, True), answer.text
    only_read = experimenter.send("POST", "/definitions/edit", {"toml": toml})
    assert (only_read.status_code, only_read.json()["data"]) == (200, None), only_read.text
    assert said in only_read.json()["problems"][0]["message"]
    assert time.process_time() - began < SOON_S


def test_of_a_hundred_thousand_unknown_keys_the_first_are_reported_at_once(
    experimenter: Admin, study: StudyInDatabase
) -> None:
    toml, began = "".join(f"[a{number}]\n" for number in range(30_000)), time.process_time()
    answer = experimenter.send("POST", "/studies/short/versions/check", {"toml": toml})
    assert answer.status_code == 422, answer.text
    assert re.search(r"and 3\d{4} more problems\)$", answer.json()["error"]["message"])
    assert time.process_time() - began < SOON_S


def test_a_long_text_of_words_and_dots_is_not_a_key(experimenter: Admin, study: StudyInDatabase) -> None:
    text = SHORT.replace("\n", f"\n# {'Look at a. ' * 3000}{'.' * 3000}\n", 1)
    answer = experimenter.send("POST", "/studies/short/versions/check", {"toml": text})
    assert answer.status_code == 200, answer.text


@pytest.mark.parametrize(
    "pattern",
    [
        "_".join(f"{{{letter}}}" for letter in "abcdefghijklmnop") + "!",
        "".join(f"{{{letter}}}" for letter in "abcdefghijklmnop") + "!",
    ],
)
def test_a_pattern_of_many_fields_is_tried_in_no_time(
    experimenter: Admin, services: Services, study: StudyInDatabase, pattern: str
) -> None:
    account = experimenter.get("/session").json()["account"]["id"]
    upload, folder = new_upload(
        Quota(services.settings.upload_folder, account, services.settings.max_uploads_bytes)
    )
    (folder / ("a_" * 120 + ".mp4")).write_bytes(b"no video")
    own: dict[str, Any] = {"title": "t", "question": "q", "low": "a", "high": "b"}
    began = time.process_time()
    answer = experimenter.send(
        "POST", "/studies", {"name": "x", "upload": upload, "levels": {"pattern": pattern}, "own_clips": own}
    )
    assert (answer.status_code, "does not match the pattern" in answer.text) == (422, True), answer.text
    assert time.process_time() - began < SOON_S


def test_a_table_with_a_cell_without_end_is_refused_in_words(
    experimenter: Admin, services: Services, study: StudyInDatabase
) -> None:
    account = experimenter.get("/session").json()["account"]["id"]
    upload, folder = new_upload(
        Quota(services.settings.upload_folder, account, services.settings.max_uploads_bytes)
    )
    (folder / "a.mp4").write_bytes(b"no video")
    csv = 'file,a\n"' + "x" * 200_000
    answer = experimenter.send("POST", "/studies", {"name": "x", "upload": upload, "levels": {"csv": csv}})
    assert answer.status_code == 422, answer.text
