"""Signed addresses of recruiters: who shows one has it from the experimenters, and may go on with a visit.

secret = HMAC-SHA-256(k, "recruiter signature:" study key ":" name) with k the installation's key and the
study's own, so that it is no other study's; another name makes another secret, by which all addresses that
were signed before are good no more. The signature of a participant's id is HMAC-SHA-256(secret, id), 64
hexadecimal digits.
"""

import hashlib
import hmac
from collections.abc import Mapping

from server.participants.recruiter import Recruiter
from server.participants.refusals import SignatureMissing, SignatureWrong

PURPOSE = "recruiter signature"


def signing_secret(key: bytes, study_key: str, name: str) -> bytes:
    """The secret of this name by which addresses of a study are signed."""
    return hmac.digest(key, f"{PURPOSE}:{study_key}:{name}".encode("utf-8", "surrogatepass"), hashlib.sha256)


def signature_of(secret: bytes, identifier: str) -> str:
    """The signature of a participant's id."""
    return hmac.digest(secret, identifier.encode("utf-8", "surrogatepass"), hashlib.sha256).hex()


def is_signed(key: bytes, study_key: str, recruiter: Recruiter, parameters: Mapping[str, str]) -> bool:
    """Whether an address is signed; refused where it names somebody and should be, and is not rightly.

    False where the recruiter declares no signature, or the address names nobody.
    """
    identifier = recruiter.participant(parameters)
    if not recruiter.signature_parameter or identifier is None:
        return False
    given = parameters.get(recruiter.signature_parameter, "")
    if not given:
        raise SignatureMissing(
            f"Expected an address with a signature ({recruiter.signature_parameter}=...), got one without; "
            "please open the whole address that you were given."
        )
    right = signature_of(signing_secret(key, study_key, recruiter.secret_name), identifier)
    # Bytes, since text beyond ASCII cannot be compared in constant time.
    if not hmac.compare_digest(right.encode(), given.lower().encode("utf-8", "surrogatepass")):
        raise SignatureWrong(
            f"The signature in the address ({recruiter.signature_parameter}=...) is not that of this "
            "participant and study; please open the whole address that you were given."
        )
    return True


def without_signature(recruiter: Recruiter, parameters: Mapping[str, str]) -> dict[str, str]:
    """The parameters of an address to store: the signature, which opens a visit, by its hash alone."""
    name = recruiter.signature_parameter
    return {**parameters, name: _hash(parameters[name])} if name and name in parameters else dict(parameters)


def is_of(recruiter: Recruiter, parameters: Mapping[str, str], stored: Mapping[str, str]) -> bool:
    """Whether a visit with these `stored` parameters began by the signature of this address."""
    name = recruiter.signature_parameter
    return name in parameters and stored.get(name) == _hash(parameters[name])


def _hash(signature: str) -> str:
    digest = hashlib.sha256(signature.lower().encode("utf-8", "surrogatepass"))
    return f"sha256:{digest.hexdigest()}"
