from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families

from server.context import Services
from server.core.settings import Settings
from tests.helpers.studies import Participant

TOKEN = "for prometheus"


def with_token(client: TestClient, services: Services) -> None:
    settings: Settings = services.settings.model_copy(update={"metrics_token": TOKEN})
    client.app.state.services = Services(**{**vars(services), "settings": settings})  # type: ignore[attr-defined]


def scrape(client: TestClient) -> dict[tuple[str, tuple[tuple[str, str], ...]], float]:
    answer = client.get("/metrics", headers={"authorization": f"Bearer {TOKEN}"})
    assert answer.status_code == 200
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }


def test_answers_and_runs_are_counted_by_route_without_any_token(
    client: TestClient, services: Services, participant: Participant
) -> None:
    with_token(client, services)
    key = (
        "palpebra_answers_total",
        (("method", "POST"), ("route", "/api/links/{link_token}/runs"), ("status", "201")),
    )
    before = scrape(client).get(key, 0)
    participant.agree()
    after = scrape(client)
    assert after[key] == before + 1
    assert (
        after[
            "palpebra_runs",
            (("origin", "participant"), ("phase", "live"), ("status", "active"), ("study", "short")),
        ]
        == 1
    )
    text = client.get("/metrics", headers={"authorization": f"Bearer {TOKEN}"}).text
    assert participant.token not in text
    assert participant.link not in text


def test_an_address_nobody_declared_makes_no_label_of_its_own(client: TestClient, services: Services) -> None:
    with_token(client, services)
    client.get("/some/secret/thing")
    labels = [
        dict(labels).get("route") for name, labels in scrape(client) if name == "palpebra_answers_total"
    ]
    assert "unmatched" in labels or "/{rest:path}" in labels
    assert not any("secret" in str(label) for label in labels)


class TestWhoMayAsk:
    def test_without_a_token_this_machine_alone(self, client: TestClient, services: Services) -> None:
        assert client.get("/metrics").status_code == 403  # the test client comes from "testclient"
        here = TestClient(client.app, client=("127.0.0.1", 50000))
        assert here.get("/metrics").status_code == 200
        assert here.get("/metrics", headers={"x-forwarded-for": "198.51.100.7"}).status_code == 403

    def test_with_a_token_nobody_without(self, client: TestClient, services: Services) -> None:
        with_token(client, services)
        here = TestClient(client.app, client=("127.0.0.1", 50000))
        assert here.get("/metrics").status_code == 403
        assert here.get("/metrics", headers={"authorization": "Bearer other"}).status_code == 403
