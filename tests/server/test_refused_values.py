"""Every body that an endpoint takes answers a wrong value in words, without showing it."""

import re
import sys
from typing import Any

import pytest
from fastapi.testclient import TestClient
from pydantic import BaseModel, ValidationError

from server.app import create_app
from server.core.errors import refused_value

SECRET = "a secret"
WRONG: tuple[Any, ...] = (
    SECRET,
    "",
    -3,
    2.5,
    True,
    None,
    [SECRET],
    {SECRET: 1},
    [[]],
    10**400,
    SECRET * 10**5,
)
OF_PYDANTIC = re.compile(r"Input|[Tt]uple|dictionary|instance|String|[Ff]ield|Extra|Unable|Value error")


def bodies() -> list[type[BaseModel]]:
    """The models of requests: those of the endpoints' schemas that refuse unknown names."""
    create_app()
    modules = [module for name, module in sys.modules.items() if re.fullmatch(r"server\..*schemas", name)]
    models = {
        one
        for module in modules
        for one in vars(module).values()
        if isinstance(one, type) and issubclass(one, BaseModel) and one.__module__ == module.__name__
    }
    requests = [model for model in models if model.model_config.get("extra") == "forbid"]
    return sorted(requests, key=lambda model: (model.__module__, model.__qualname__))


def refusals(model: type[BaseModel], value: dict[str, Any]) -> list[str]:
    """What is said of a body."""
    try:
        model.model_validate(value)
    except ValidationError as error:
        return [refused_value({**detail, "loc": ("body", *detail["loc"])}) for detail in error.errors()]
    return []


@pytest.mark.parametrize("model", bodies(), ids=lambda model: model.__name__)
def test_wrong_values_are_answered_in_words_and_not_shown(model: type[BaseModel]) -> None:
    for name in model.model_fields:
        for value in WRONG:
            for sentence in refusals(model, {name: value}):
                assert not OF_PYDANTIC.search(sentence), sentence
                assert len(sentence) < 400
                assert not re.search(f"got.*{SECRET}", sentence), sentence


@pytest.mark.parametrize(
    ("detail", "sentence"),
    [
        ({"type": "missing", "loc": ("body", "name")}, "body.name: this value is required but missing"),
        (
            {"type": "extra_forbidden", "loc": ("body", "nmae"), "input": 1},
            "body.nmae: unknown value; remove it",
        ),
        (
            {"type": "less_than_equal", "loc": ("query", "page"), "input": 10, "ctx": {"le": 9}},
            "query.page: expected at most 9, got 10",
        ),
        (
            {
                "type": "string_too_short",
                "loc": ("body", "password"),
                "input": "a",
                "ctx": {"min_length": 10},
            },
            "body.password: expected a text of 10 characters or more, got a text of 1 character",
        ),
        (
            {"type": "json_invalid", "loc": ("body", 1), "ctx": {"error": "Expecting value"}},
            "body.1: expected JSON, got something else (Expecting value)",
        ),
        (
            {"type": "value_error", "loc": ("body", "mail"), "msg": "Value error, expected a@b.c, got 'a'"},
            "body.mail: expected a@b.c, got 'a'",
        ),
    ],
)
def test_the_words_of_each_kind(detail: dict[str, Any], sentence: str) -> None:
    assert refused_value({"input": None, "msg": "", **detail}) == sentence


def test_an_endpoint_says_what_came_but_not_a_password(client: TestClient) -> None:
    answer = client.post("/api/admin/session", json={"name": "x", "password": [SECRET]})
    assert answer.status_code == 422
    assert answer.json()["error"]["message"] == "body.password: expected a text, got a list of 1 item"
    assert SECRET not in answer.text
