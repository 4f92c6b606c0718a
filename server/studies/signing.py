"""How the recruiter's side signs addresses of a study, for its owners."""

from urllib.parse import urlencode

from sqlalchemy.orm import Session

from server.accounts.audit import record
from server.accounts.identity import Identity
from server.models import Link, Study
from server.participants.recruiter import stored_recruiter
from server.participants.signatures import signature_of, signing_secret
from server.studies.link_schemas import Signing

EXAMPLE_ID = "P-0001"
USUAL_PARAMETER = "signature"
PYTHON = (
    "import hashlib, hmac\n\n"
    'secret = bytes.fromhex("{secret}")\n'
    'print(hmac.new(secret, "{identifier}".encode(), hashlib.sha256).hexdigest())'
)
SHELL = "printf %s '{identifier}' | openssl dgst -sha256 -mac HMAC -macopt hexkey:{secret}"


def signing(
    session: Session,
    key: bytes,
    study: Study,
    name: str | None,
    identity: Identity | None,
    link: Link | None = None,
) -> Signing:
    """The secret of a study with examples of its use; that somebody looked is written down.

    Parameters
    ----------
    name : str or None
        Of the secret; that of the recruiter where None.
    link : Link, optional
        Whose recruiter it is, where it has its own; the study's where None.
    """
    recruiter = stored_recruiter((link.recruiter if link else None) or study.recruiter)
    used = recruiter.secret_name if name is None else name
    record(session, identity, "signing secret read", "study", study.name, secret_name=used)
    secret = signing_secret(key, study.pseudonym_key, used)
    filled = {"secret": secret.hex(), "identifier": EXAMPLE_ID}
    signature = signature_of(secret, EXAMPLE_ID)
    parameter = recruiter.signature_parameter or USUAL_PARAMETER
    return Signing(
        declared=bool(recruiter.signature_parameter),
        parameter=parameter,
        secret_name=used,
        secret=secret.hex(),
        identifier=EXAMPLE_ID,
        signature=signature,
        query=urlencode({recruiter.id_name: EXAMPLE_ID, parameter: signature}),
        python=PYTHON.format(**filled),
        shell=SHELL.format(**filled),
    )
