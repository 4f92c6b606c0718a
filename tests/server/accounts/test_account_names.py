"""Names that an account may have, explained to the person who chooses one."""

import pytest
from pydantic import ValidationError

from server.accounts.schemas import NewAccount


@pytest.mark.parametrize("name", ["Zoë 😀", "a", "x" * 101, "a\tb"])
def test_a_name_that_cannot_be_signed_in_with_is_refused_in_words(name: str) -> None:
    with pytest.raises(ValidationError, match="expected 2 to 100 letters, digits, spaces or any of"):
        NewAccount(name=name, password="a long enough one")


def test_letters_of_any_script_are_taken() -> None:
    assert NewAccount(name=" Zoë Ångström-李 ", password="a long enough one").name == "Zoë Ångström-李"
