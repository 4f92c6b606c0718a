"""Tickets: good for one play of one trial of one run, and for nothing else."""

from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.core.errors import ApiError
from server.participation.intake import LIFETIME, check_ticket, evidence_key, issue, ticket, tickets
from server.participation.refusals import (
    TicketExpired,
    TicketInvalid,
    TicketOfAnotherRun,
    TicketOfAnotherTrial,
)

KEY = evidence_key(b"secret")
MOMENT = datetime(2026, 11, 21, 12, tzinfo=UTC)


def test_each_ticket_opens_its_own_play_and_shows_when_it_was_issued() -> None:
    batch = issue(KEY, "run1", MOMENT)
    issued = tickets(KEY, batch, [2, 1])
    assert [len(plays) for plays in issued] == [2, 1]
    assert len({code for plays in issued for code in plays}) == 3
    opened = check_ticket(KEY, batch.text, issued[0][1], "run1", 0, 2, MOMENT)
    assert opened.issued_at == MOMENT


@pytest.mark.parametrize(
    ("run", "trial", "play", "late", "refusal"),
    [
        ("run2", 0, 1, timedelta(), TicketOfAnotherRun),
        ("run1", 1, 1, timedelta(), TicketOfAnotherTrial),
        ("run1", 0, 2, timedelta(), TicketOfAnotherTrial),
        ("run1", 0, 1, LIFETIME + timedelta(seconds=1), TicketExpired),
    ],
)
def test_a_ticket_for_something_else_is_refused_by_name(
    run: str, trial: int, play: int, late: timedelta, refusal: type[ApiError]
) -> None:
    batch = issue(KEY, "run1", MOMENT)
    with pytest.raises(refusal):
        check_ticket(KEY, batch.text, ticket(KEY, batch, 0, 1), run, trial, play, MOMENT + late)


@given(st.data())
def test_no_changed_batch_opens(data: st.DataObject) -> None:
    batch = issue(KEY, "run1", MOMENT).text
    place = data.draw(st.integers(0, len(batch) - 1))
    # The last digit of a code holds two bits that decoding would drop; the text is compared, so they count.
    other = data.draw(
        st.sampled_from("abcdefghijklmnopqrstuvwxyz0123456789._-é").filter(lambda c: c != batch[place])
    )
    changed = batch[:place] + other + batch[place + 1 :]
    with pytest.raises(TicketInvalid):
        check_ticket(KEY, changed, "x", "run1", 0, 1, MOMENT)


def test_another_installation_s_batch_is_refused() -> None:
    batch = issue(evidence_key(b"other"), "run1", MOMENT)
    with pytest.raises(TicketInvalid):
        check_ticket(KEY, batch.text, "x", "run1", 0, 1, MOMENT)
