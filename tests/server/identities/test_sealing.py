"""A recruiter's ID opens by its own key, its run and the installation's secret key, and by nothing else."""

import base64
import json
from dataclasses import replace

import pytest
from cryptography.hazmat.primitives.ciphers.aead import AESGCM
from hypothesis import given
from hypothesis import strategies as st

from server.participation.identity_keys import (
    ParticipantIdentity,
    UnreadableError,
    identifier_hash,
    rewrap,
    seal,
    unseal,
    unwrap,
)

SECRET, RUN = b"the installation's", "0123456789abcdef"
ANY_TEXT = st.text(st.characters(codec=None, exclude_categories=()), max_size=60)
STUDY_KEY = "00" * 31 + "01"


@given(ANY_TEXT, st.dictionaries(ANY_TEXT, ANY_TEXT, max_size=4))
def test_what_was_sealed_comes_back(identifier: str, parameters: dict[str, str]) -> None:
    known = ParticipantIdentity(identifier, parameters)
    sealed = seal(SECRET, RUN, known)
    assert unseal(SECRET, RUN, sealed) == known
    assert seal(SECRET, RUN, known) != sealed


@pytest.mark.parametrize("change", ["secret", "run", "content", "key", "another key", "no key", "no text"])
def test_nothing_else_opens_it(change: str) -> None:
    sealed, other = (
        seal(SECRET, RUN, ParticipantIdentity("5a9d")),
        seal(SECRET, RUN, ParticipantIdentity("77b2")),
    )
    flipped = bytearray(base64.b64decode(sealed.content))
    flipped[-1] ^= 1
    given_instead = {
        "secret": (b"another", RUN, sealed),
        "run": (SECRET, "f" * 16, sealed),
        "content": (SECRET, RUN, replace(sealed, content=base64.b64encode(flipped).decode())),
        "key": (SECRET, RUN, replace(sealed, wrapped_key=sealed.wrapped_key[:-8] + "AAAAAAA=")),
        "another key": (SECRET, RUN, replace(sealed, wrapped_key=other.wrapped_key)),
        "no key": (SECRET, RUN, replace(sealed, wrapped_key="")),
        "no text": (SECRET, RUN, replace(sealed, content="é")),
    }
    with pytest.raises(UnreadableError, match="server database rewrap"):
        unseal(*given_instead[change])


def test_the_content_is_aes_gcm_with_the_run_as_associated_data() -> None:
    """Read by the library alone, as anybody could who has the key."""
    sealed = seal(SECRET, RUN, ParticipantIdentity("5a9d", {"a": "b"}))
    content, key = base64.b64decode(sealed.content), unwrap(SECRET, sealed.wrapped_key)
    plain = json.loads(AESGCM(key).decrypt(content[:12], content[12:], RUN.encode()))
    assert plain == {"identifier": "5a9d", "parameters": {"a": "b"}}
    assert len(key) == 32


def test_another_secret_key_takes_the_keys_over() -> None:
    sealed = seal(SECRET, RUN, ParticipantIdentity("5a9d"))
    taken_over = replace(sealed, wrapped_key=rewrap(SECRET, b"new", sealed.wrapped_key))
    assert unseal(b"new", RUN, taken_over) == ParticipantIdentity("5a9d")
    with pytest.raises(UnreadableError):
        rewrap(b"neither", b"new", sealed.wrapped_key)


def test_duplicates_are_known_by_a_hash_of_the_study() -> None:
    assert identifier_hash(STUDY_KEY, "5a9d") == identifier_hash(STUDY_KEY, "5a9d")
    assert identifier_hash(STUDY_KEY, "5a9d") != identifier_hash("00" * 32, "5a9d")
    assert identifier_hash(STUDY_KEY, "5a9d") != identifier_hash(STUDY_KEY, "5a9e")
    assert identifier_hash(STUDY_KEY, "") == ""
