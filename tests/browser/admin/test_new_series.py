"""A new scale of a live study is asked about before it is saved; the data are found afterwards."""

import pytest
from fastapi.testclient import TestClient
from playwright.sync_api import expect

from server.accounts.identity import OPERATOR
from server.app import create_app
from server.studies.links import create_link
from server.studies.lookup import find_study
from tests.browser.admin.conftest import Dashboard
from tests.browser.admin.test_before_opening import picture
from tests.helpers.studies import Participant, link_token

pytestmark = pytest.mark.browser


def test_a_new_series_is_confirmed_and_says_where_the_answers_are(dashboard: Dashboard) -> None:
    page = dashboard.open("/studies/short/build")
    page.get_by_label("Show TOML").locator("xpath=..").click()
    text = page.get_by_label("Definition")
    saved = text.input_value()
    text.fill(saved.replace("[trial.scale]\n", "[trial.scale]\nmaximum = 9\n"))
    button = page.get_by_role("button", name="Save as a new version")
    expect(button).to_be_enabled()
    button.click()
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("4 participants answered on 1-7. This version starts a new data series")
    expect(dialog).to_contain_text("stay separate, in series 1 (version 1)")
    picture(page, "confirm-series")
    dialog.get_by_role("button", name="Cancel").click()
    expect(page.get_by_text("short, version 1")).to_be_visible()
    button.click()
    dialog.get_by_role("button", name="Save and start series 2").click()
    page.get_by_text("short, version 2").wait_for()

    page = dashboard.open("/studies/short/results")
    expect(page.get_by_text("4 participants are in series 1 (version 1).").first).to_be_visible()
    expect(page.get_by_text("No answers of participants")).to_have_count(0)
    expect(page.get_by_text("Zero participants began")).to_have_count(0)
    expect(page.get_by_text("data series 2 has no visits yet")).to_be_visible()
    picture(page, "empty-series")
    page.get_by_role("button", name="Show them").first.click()
    expect(page.get_by_text("Four participants began")).to_be_visible()
    expect(page.get_by_text("How clips were shown")).to_be_visible()

    page = dashboard.open("/studies/short/build")
    page.get_by_label("Show TOML").locator("xpath=..").click()
    text = page.get_by_label("Definition")
    text.fill(text.input_value() + "\n# more\n")
    text.fill(text.input_value().replace('title = "A short study"', 'title = "A shorter study"'))
    status = page.get_by_role("status").filter(has_text="has no runs yet")
    expect(status).to_contain_text("Series 2 has no runs yet; 4 runs are in series 1 (version 1).")
    expect(page.get_by_text("No one has taken part yet")).to_have_count(0)

    # Answers in the new series do not hide those of the first.
    with dashboard.server.services() as services, services.database.write() as session:
        link = create_link(
            session, services.settings.key, find_study(session, "short", OPERATOR, "see"), "general"
        )
        token = link_token(services, link)
    with TestClient(create_app(dashboard.server.settings)) as client:
        person = Participant(client, token).agree()
        for trial in person.state()["trials"]:
            person.rate(trial, 8)
    page = dashboard.open("/studies/short/results")
    expect(page.get_by_text("Data series 2, participants: 1 run with answers, 8 answers")).to_be_visible()
    expect(page.get_by_text("4 participants are in series 1 (version 1).")).to_have_count(1)
    page.get_by_role("button", name="Show them").click()
    expect(page.get_by_text("Data series 1, participants: 4 runs with answers")).to_be_visible()
    expect(page.get_by_text("1 participant is in series 2 (version 2).")).to_be_visible()
