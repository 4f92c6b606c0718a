"""Groups and samples as the server deals them: who sees which clips, and who takes a place given up."""

from collections import Counter
from pathlib import Path

from fastapi.testclient import TestClient

from server.context import Services
from server.models import VersionClip
from tests.helpers.studies import SHORT, Participant, add_study

TEXT = SHORT.replace('label = "Speed"', 'label = "Speed"\nbetween = true').replace(
    "[blocks]", "[assignment]\nclips_per_cell = 1\n\n[blocks]"
)


def speeds(person: Participant, speed_of: dict[str, str]) -> Counter[str]:
    """Levels of the factor between participants that a person's clips have, practice included."""
    shown = (trial["clip_sha256"] for trial in person.state()["trials"])
    return Counter(speed_of[sha256] for sha256 in shown if sha256)


def test_groups_take_turns_and_a_place_given_up_goes_to_the_same_group(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", TEXT, "groups")
    with services.database.read() as session:
        speed_of = {clip.clip_sha256: clip.levels["speed"] for clip in session.query(VersionClip)}
    people = [Participant(client, study.link_token).agree() for _ in range(4)]
    # Two characters, one clip of each of the group's cells, and two practice trials.
    assert [speeds(person, speed_of) for person in people] == [{"slow": 4}, {"fast": 4}] * 2
    people[1].request("POST", "/withdraw")
    assert speeds(Participant(client, study.link_token).agree(), speed_of) == {"fast": 4}
    assert speeds(Participant(client, study.link_token).agree(), speed_of) == {"slow": 4}
