"""How late and how surely a picture's time holds: columns of every row of answers."""

import csv
import io

import pytest

from server.context import Services
from server.exports.formats import ratings_csv
from server.exports.schemas import Extract
from server.models import Study
from tests.helpers.studies import Participant

CHROMIUM = (
    "Mozilla/5.0 (X11; Linux x86_64) AppleWebKit/537.36 (KHTML, like Gecko) Chrome/146.0.0.0 Safari/537.36"
)
FIREFOX = "Mozilla/5.0 (X11; Linux x86_64; rv:140.0) Gecko/20100101 Firefox/140.0"
SAFARI = "Mozilla/5.0 (Macintosh) AppleWebKit/605.1.15 (KHTML, like Gecko) Version/26.0 Safari/605.1.15"


@pytest.mark.parametrize(
    ("user_agent", "refresh_rate_hz", "delay", "uncertainty"),
    [
        (CHROMIUM, 60.0, 0.0, 16.67),
        (CHROMIUM, 120.0, 0.0, 8.33),
        (FIREFOX, 60.0, 16.67, 16.67),
        (FIREFOX, 120.0, 8.33, 8.33),
        (SAFARI, 60.0, None, 16.67),
    ],
)
def test_the_delay_is_that_of_the_browser_in_refreshes(
    participant: Participant,
    services: Services,
    user_agent: str,
    refresh_rate_hz: float,
    delay: float | None,
    uncertainty: float,
) -> None:
    participant.start(device={"user_agent": user_agent})
    participant.request("PUT", "/consent", {"agreed": True})
    shown = next(trial for trial in participant.state()["trials"] if trial["clip_sha256"])
    participant.rate(shown, playback={"refresh_rate_hz": refresh_rate_hz})
    (row,) = exported(services)
    assert number(row["onset_delay_ms"]) == delay
    assert number(row["onset_uncertainty_ms"]) == uncertainty


def test_nothing_is_promised_of_plays_that_are_not_good(participant: Participant, services: Services) -> None:
    participant.start(device={"user_agent": CHROMIUM})
    participant.request("PUT", "/consent", {"agreed": True})
    shown = next(trial for trial in participant.state()["trials"] if trial["clip_sha256"])
    participant.rate(shown, playback={"clock_gap_ms": 80.0})
    (row,) = exported(services)
    assert row["verdict"] != "good"
    assert number(row["onset_delay_ms"]) == 0.0
    assert row["onset_uncertainty_ms"] == ""


def exported(services: Services) -> list[dict[str, str]]:
    """Rows of ratings.csv."""
    with services.database.read() as session:
        study = session.query(Study).one()
        text = b"".join(ratings_csv(session, study, Extract("all"))).decode("utf-8")
    return list(csv.DictReader(io.StringIO(text, newline="")))


def number(cell: str) -> float | None:
    """A cell's number; None where it is empty."""
    return float(cell) if cell else None
