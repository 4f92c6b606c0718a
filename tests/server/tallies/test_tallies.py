"""What is counted with each rating is what a full count gives, on both databases."""

import uuid
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import Connection, delete, select, update

from server.context import Services
from server.core.settings import Settings
from server.core.values import now
from server.models import Rating, RunTally, StudyRun
from server.operations import doctor
from server.participation import ratings
from server.participation.answer_schemas import RatingIn
from server.participation.tallies import Play, Tally, TallyEntry, tally_of, unpack_answer
from server.participation.tally_pools import Recount
from tests.helpers.admins import Admin
from tests.helpers.databases import run_server_command
from tests.helpers.studies import Participant, good_playback, rated

small = st.integers(0, 2**18 - 1)
values = st.integers(-100_000, 134_217_000).map(lambda units: units / 1000)
answers = st.builds(
    TallyEntry,
    st.sampled_from(["", "naturalness"]),
    small,
    st.none() | small.filter(lambda n: n < 2**18 - 1),
    values,
)
plays = st.builds(
    Play,
    st.integers(0, 30),
    st.booleans(),
    st.sampled_from(["good", "uncertain", "flagged", "failed"]),
    st.sampled_from(["", "focus_lost"]),
    st.just("webcodecs"),
    st.none() | st.floats(0, 1e6),
    st.none() | st.floats(0, 500),
    st.lists(answers.map(lambda one: one._replace(cell=one.clip % 7)), max_size=2).map(tuple),
)


def tallied(given_plays: list[Play]) -> Tally:
    tally = Tally()
    for play in given_plays:
        tally.add(play)
    return tally


@given(answers)
def test_a_packed_answer_is_the_answer(answer: TallyEntry) -> None:
    assert unpack_answer(answer.packed()) == (answer.clip, answer.second, answer.value)


@given(st.lists(plays, max_size=12), st.randoms())
def test_a_stored_tally_is_the_tally_in_whatever_order_its_plays_came(given_plays, random) -> None:
    made = tallied(given_plays)
    assert tally_of(*made.values().values()) == made
    random.shuffle(given_plays)
    assert tallied(given_plays).same(made)


def finding(services: Services) -> doctor.Finding:
    return next(doctor.counts(services))


def differing(services: Services) -> list[int]:
    with services.database.read() as session:
        return list(Recount(services.versions).differing(session))


def test_every_kind_of_play_is_counted_as_it_is_stored(participant: Participant, services: Services) -> None:
    trials = participant.agree().state()["trials"]
    mains = [trial for trial in trials if trial["kind"] == "main"]
    participant.rate(mains[0], None, playback={"method": "none"})
    participant.rate(mains[0], 6, play=2)
    participant.rate(mains[1], 2, playback={"frames_missing": 2, "frames_drawn": 2})
    participant.rate(mains[2], 7, playback={"method": "video", "clock_gap_ms": None})
    participant.rate_all()
    assert differing(services) == []
    assert finding(services).verdict == "ok"
    with services.database.read() as session:
        row = session.scalars(select(RunTally)).one()
        tally = tally_of(row.heat, row.not_good, row.counts, row.answers)
        stored = session.scalars(select(Rating)).all()
    assert tally.not_good == sum(one.verdict in ("flagged", "failed") for one in stored) >= 2
    assert sorted(unpack_answer(code)[2] for code in tally.answers["rating"]) == [2, 4, 4, 4, 4, 4, 6, 7]
    assert sum(tally.cells["rating"][::2]) == 8
    assert sum(tally.cells["rating"][1::2]) == 35_000
    assert sum(tally.plays.values()) == 9
    assert len(tally.heat) == len(trials)


def test_doctor_tells_of_wrong_counts_and_a_recount_mends_them(
    participant: Participant, settings: Settings, services: Services
) -> None:
    participant.agree().rate_all()
    with services.database.write() as session:
        session.execute(update(RunTally).values(not_good=RunTally.not_good + 1))
    assert finding(services).verdict == "failed"
    assert finding(services).state == "the stored counts of 1 of 1 run differ from their ratings"
    assert run_server_command(settings, "database", "recount").stdout == "1 run counted, 1 corrected\n"
    assert finding(services).verdict == "ok"
    with services.database.write() as session:
        newest = select(Rating.id).order_by(Rating.id.desc()).limit(1).scalar_subquery()
        session.execute(delete(Rating).where(Rating.id == newest))
    assert len(differing(services)) == 1
    assert run_server_command(settings, "database", "recount").returncode == 0
    assert differing(services) == []


def test_an_erased_person_leaves_no_counts(
    experimenter: Admin, participant: Participant, services: Services
) -> None:
    participant.agree().rate_all()
    run = f"/studies/short/runs/{participant.run_id}"
    experimenter.send("POST", f"{run}/erase", {"confirm": participant.run_id})
    with services.database.read() as session:
        assert session.scalars(select(RunTally)).all() == []
    assert differing(services) == []


def test_ratings_of_one_run_at_once_are_all_counted(participant: Participant, services: Services) -> None:
    trials = [trial for trial in participant.agree().state()["trials"] if trial["kind"] != "attention"]

    def save(trial: Any) -> None:
        body = {"trial_index": trial["trial_index"], "answer": rated(4), "playback": good_playback(trial)}
        rating = RatingIn.model_validate(body)
        with services.database.write_connection() as connection:
            _save(services, connection, participant.token, rating)

    with ThreadPoolExecutor(max_workers=5) as several:
        list(several.map(save, trials))
    assert differing(services) == []
    with services.database.read() as session:
        assert session.scalars(select(StudyRun)).one().trials_answered == len(trials) == 10


def _save(services: Services, connection: Connection, token: str, rating: RatingIn) -> None:
    ratings.save_rating(
        services.versions, services.intake, connection, token, str(uuid.uuid4()), rating, now()
    )
