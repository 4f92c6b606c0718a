"""Where participants come from and go back to, and the signed URLs of recruiters."""

import hashlib
import hmac
import re
import unicodedata
from collections.abc import Mapping
from typing import Annotated, Any, Literal
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict, StringConstraints

from server.participation.refusals import IdentifierInvalid, RecruiterNotSet, SignatureMissing, SignatureWrong

# Where participants come from and go back to: Prolific, SONA, MTurk, or any other address.
#
# A recruiter's ID arrives in an address that anybody can write. It is checked against the form in which that
# recruiter writes its ids, and ids that differ only in case or blanks are one person's.
#
# A study's (or link's) `recruiter` is an object with these keys, all but `kind` optional: kind: prolific,
# sona, mturk or generic. id_parameter: which address parameter names the participant. redirect_url: where
# to go at the end; {code}, {run} and {any address parameter} are filled in. redirect_declined: where people
# go who do not agree, or whose device is not suitable; without it Prolific's own page, elsewhere none.
# redirect_screened_out: where to go when screened out; on Prolific redirect_url, if there is a code for it.
# code_complete, code_failed_check: completion codes; one is made for each run where absent.
# code_screened_out: the code of people who are screened out; without it none is shown, so that nobody is paid
# by mistake. signature_parameter: which address parameter has the signature of the participant's id (here,
# below); without it addresses are not signed. secret_name: another name makes another secret.

Code = Annotated[str, StringConstraints(max_length=100)]
Address = Annotated[str, StringConstraints(max_length=1000, pattern=r"^(https?://.*)?$")]
"""As every release took it; what is taken today is narrower."""
ID_PARAMETERS = {
    "prolific": "PROLIFIC_PID",
    "sona": "survey_code",
    "mturk": "workerId",
    "generic": "participant",
}
NAMES = {"prolific": "Prolific", "sona": "SONA", "mturk": "Amazon Mechanical Turk"}
"""Recruiters that have a name."""
ID_FORMS = {
    "prolific": (r"[0-9a-f]{24}", "24 letters and digits from 0-9 and a-f"),
    "sona": (r"[0-9a-z_-]{1,64}", "letters and digits"),
    "mturk": (r"a[0-9a-z]{7,30}", "the letter A and 8 to 31 letters and digits in all"),
    "generic": (
        r"[\w-][^\x00-\x1f\x7f;]{0,199}",
        "at most 200 characters without a semicolon, the first a letter, a digit, _ or -",
    ),
}
"""How each recruiter writes its ids, as a pattern of the canonical id and in words."""
WEB_ADDRESS = r"^(https?://[^/?#{}@\\\s\x00-\x1f\x7f]+([/?#][^\x00-\x1f\x7f]*)?)?$"
"""The host is written out: what an address says of a participant must not decide where others are sent."""
PROLIFIC_HOME = "https://app.prolific.com/"
PROLIFIC_URL = "https://app.prolific.com/submissions/complete?cc={code}"


class Recruiter(BaseModel):
    """How a recruiter sends participants and takes them back; see the module for each key."""

    # What is sent is checked by `without_refused`: an address that an earlier release took may stay. What is
    # stored is read by `stored_recruiter`.

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: Literal["prolific", "sona", "mturk", "generic"] = "generic"
    id_parameter: Code = ""
    redirect_url: Address = ""
    redirect_declined: Address = ""
    redirect_screened_out: Address = ""
    code_complete: Code = ""
    code_failed_check: Code = ""
    code_screened_out: Code = ""
    signature_parameter: Code = ""
    secret_name: Code = ""

    @property
    def id_name(self) -> str:
        """The address parameter that names the participant."""
        return self.id_parameter or ID_PARAMETERS[self.kind]

    def participant(self, parameters: Mapping[str, str]) -> str | None:
        """The participant's id as the address writes it; None where it is not there."""
        return parameters.get(self.id_name) or None

    def canonical_id(self, parameters: Mapping[str, str]) -> str | None:
        """The id by which visits of one person are known; None where the address names nobody.

        Raises
        ------
        IdentifierInvalid
            The id is not written as this recruiter writes its ids.
        """
        identifier = self.participant(parameters)
        if identifier is None:
            return None
        canonical = self.same_id(identifier)
        pattern, in_words = ID_FORMS[self.kind]
        if not re.fullmatch(pattern, canonical.casefold()):
            raise IdentifierInvalid(
                f"{self.id_name}: expected {in_words}, got '{identifier[:40]}'. Please open the study "
                f"again with the complete link that you received."
            )
        return canonical

    def same_id(self, identifier: str) -> str:
        """The one text that stands for all ways to write an id: without blanks, in one case and width."""
        folded = "".join(unicodedata.normalize("NFKC", identifier).split()).casefold()
        return folded.upper() if self.kind == "mturk" else folded  # as Mechanical Turk writes them

    def code(self, outcome: Literal["complete", "failed_check"], own: str) -> str:
        """The declared code of this outcome, or the run's own."""
        failed = self.code_failed_check if outcome == "failed_check" else ""
        return failed or self.code_complete or own

    def redirect(self, code: str, run: str, parameters: Mapping[str, str]) -> str | None:
        """The address to go to with this code; None where there is none."""
        address = self.redirect_url or (PROLIFIC_URL if self.kind == "prolific" else "")
        return _filled_in(address, code, run, parameters)

    def way_back(self) -> str | None:
        """The address for people who take no part, {address parameters} not filled in; None without one."""
        return self.redirect_declined or (PROLIFIC_HOME if self.kind == "prolific" else None)

    def redirect_screened_out_to(self, run: str, parameters: Mapping[str, str]) -> str | None:
        """The address for people screened out; the ordinary one only with a code: it may grant a credit."""
        if self.redirect_screened_out:
            return _filled_in(self.redirect_screened_out, self.code_screened_out, run, parameters)
        by_code = self.kind == "prolific" and self.code_screened_out
        return self.redirect(self.code_screened_out, run, parameters) if by_code else None


def refuse_other_recruiter(recruiter: Recruiter, parameters: Mapping[str, str]) -> None:
    """RecruiterNotSet where the address is another recruiter's: its id and code would be lost.

    Without this a person could take part any number of times, with a completion code that pays nobody.
    """
    if recruiter.participant(parameters):
        return
    for kind, name in NAMES.items():
        parameter = ID_PARAMETERS[kind]
        if parameters.get(parameter) and parameter != recruiter.id_name:
            raise RecruiterNotSet(
                f"This study is not set up for participants from {name}. Please return your submission "
                "there and write to the researchers; nothing was stored."
            )


def stored_recruiter(declared: Mapping[str, Any] | None) -> Recruiter:
    """What a study or link has stored; an address that only an earlier release took is left out."""
    refused = refused_addresses(declared)
    return Recruiter.model_validate(
        {
            name: value
            for name, value in (declared or {}).items()
            if name not in refused and not (name.startswith("redirect_") and value is None)
        }
    )


def refused_addresses(declared: Mapping[str, Any] | None) -> list[str]:
    """The keys of return addresses that nobody is sent to."""
    addresses = ((name, value) for name, value in (declared or {}).items() if name.startswith("redirect_"))
    return [name for name, value in addresses if value and not re.fullmatch(WEB_ADDRESS, value)]


def without_refused(recruiter: Recruiter, stored: Mapping[str, Any] | None = None) -> Recruiter:
    """The recruiter as it was sent.

    Parameters
    ----------
    stored : mapping, optional
        The earlier recruiter. An address in it that is refused today may be sent again as it is: a study
        with one can be paused.

    Raises
    ------
    ValueError
        Another return address has a host that is not written out, or is not a web address.
    """
    sent = recruiter.model_dump()
    new = [name for name in refused_addresses(sent) if sent[name] != (stored or {}).get(name)]
    if new:
        raise ValueError(
            f"{new[0]}: expected a web address such as https://example.org/done?id={{run}} whose host is "
            f"written out, got '{sent[new[0]][:100]}'"
        )
    return recruiter


def _filled_in(address: str, code: str, run: str, parameters: Mapping[str, str]) -> str | None:
    # The run's values last: a parameter that is called code must not take the code's place.
    for name, value in {**parameters, "code": code, "run": run}.items():
        # Wholly quoted: what an address says of a person must not add a parameter or a path.
        address = address.replace("{" + name + "}", quote(value, safe=""))
    return address or None


# Signed URLs of recruiters: who shows one has it from the experimenters, and may go on with a visit.
#
# secret = HMAC-SHA-256(k, "recruiter signature:" study key ":" name) with k the installation's key and the
# study's own, so that it is not another study's; another name makes another secret, by which all addresses
# that were signed before are good no more. The signature of a participant's id is HMAC-SHA-256(secret, id),
# 64 hexadecimal digits.

PURPOSE = "recruiter signature"


def signing_secret(key: bytes, study_key: str, name: str) -> bytes:
    """The secret of this name by which addresses of a study are signed."""
    return hmac.digest(key, f"{PURPOSE}:{study_key}:{name}".encode("utf-8", "surrogatepass"), hashlib.sha256)


# Decision 0701: Signed URLs open a visit.
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
            f"Expected an address with a signature ({recruiter.signature_parameter}=...), got one without. "
            f"Please open the complete link that you received."
        )
    right = signature_of(signing_secret(key, study_key, recruiter.secret_name), identifier)
    # Bytes, since text beyond ASCII cannot be compared in constant time.
    if not hmac.compare_digest(right.encode(), given.lower().encode("utf-8", "surrogatepass")):
        raise SignatureWrong(
            f"The signature in the address ({recruiter.signature_parameter}=...) does not match this "
            f"participant and study. Please open the complete link that you received."
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
