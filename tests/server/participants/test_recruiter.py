import pytest
from pydantic import ValidationError

from server.participation.recruiter import Recruiter


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        ("prolific", {"PROLIFIC_PID": "p1"}),
        ("sona", {"survey_code": "p1"}),
        ("mturk", {"workerId": "p1"}),
        ("generic", {"participant": "p1"}),
    ],
)
def test_the_participant_is_named_by_the_recruiters_parameter(kind, parameters) -> None:
    assert Recruiter(kind=kind).participant(parameters) == "p1"
    assert Recruiter(kind=kind).participant({}) is None


def test_an_address_is_filled_in_and_escaped() -> None:
    recruiter = Recruiter(redirect_url="https://x.example/done?code={code}&run={run}&id={survey_code}")
    url = recruiter.redirect("A&B", "r1", {"survey_code": "7 8"})
    assert url == "https://x.example/done?code=A%26B&run=r1&id=7%208"


@pytest.mark.parametrize("url", ["javascript:alert(1)", "//x.example", "ftp://x.example"])
def test_only_web_addresses_are_taken(url: str) -> None:
    with pytest.raises(ValidationError):
        Recruiter(redirect_url=url)
