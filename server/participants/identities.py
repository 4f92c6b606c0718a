"""Pseudonyms of participants, and the code by which a rater takes up a visit on another device.

A participant's name in pages and exports is `p` and twelve hexadecimal digits of HMAC-SHA-256(k, id), with k
the study's own key and id what the recruiter calls the person, or the personal link: the same for every visit
of that person to the study, another in every other study, and not to be made or undone without the key.

A resume code is twelve signs in three groups. The first four tell the visit (20 bits of its public id), the
other eight (40 bits) are derived from the installation's key. What tells a person apart is not what lets one
in: a recruiter's id is known to many, the code only to whom the page has shown it.
"""

import hashlib
import hmac

CODE_PURPOSE = "resume"
_SIGNS = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
"""Crockford's base 32: no I, L, O, U, so that a code can be read aloud and copied by hand."""
_READ_AS = str.maketrans({"I": "1", "L": "1", "O": "0"})
_GROUP, _SECRET_SIGNS, _BITS = 4, 8, 5
_HEX_DIGITS = _GROUP * _BITS // 4
CODE_SIGNS = _GROUP + _SECRET_SIGNS


def pseudonym(study_key: str, identifier: str) -> str:
    """The name of a person within one study."""
    digest = hmac.digest(
        bytes.fromhex(study_key), identifier.encode("utf-8", "surrogatepass"), hashlib.sha256
    )
    return f"p{digest.hex()[:12]}"


def resume_code(key: bytes, public_id: str) -> str:
    """The code of the run with this public id, as the page shows it."""
    digest = hmac.digest(key, f"{CODE_PURPOSE}:{public_id}".encode(), hashlib.sha256)
    secret = int.from_bytes(digest[:8], "big") >> (64 - _SECRET_SIGNS * _BITS)
    signs = _written(int(public_id[:_HEX_DIGITS], 16), _GROUP) + _written(secret, _SECRET_SIGNS)
    return "-".join(signs[start : start + _GROUP] for start in range(0, CODE_SIGNS, _GROUP))


def run_prefix(typed: str) -> str | None:
    """How the public id of the run of a typed code begins; None where it is no code."""
    signs = _signs(typed)
    if len(signs) != CODE_SIGNS or not set(signs) <= set(_SIGNS):
        return None
    number = 0
    for sign in signs[:_GROUP]:
        number = number << _BITS | _SIGNS.index(sign)
    return f"{number:0{_HEX_DIGITS}x}"


def fits(key: bytes, public_id: str, typed: str) -> bool:
    """Whether the typed code is that of this run."""
    return hmac.compare_digest(_signs(resume_code(key, public_id)).encode(), _signs(typed).encode())


def _written(number: int, signs: int) -> str:
    return "".join(_SIGNS[number >> _BITS * start & 31] for start in reversed(range(signs)))


def _signs(typed: str) -> str:
    return "".join(typed.upper().replace("-", " ").split()).translate(_READ_AS)
