"""Who may send clips: recognised before the body of an upload is read."""

from typing import Annotated

from fastapi import Depends, Request

from server.accounts.identity import Identity, NotAllowed
from server.accounts.permission import WRITER, Writer
from server.context import Services, ServicesDep
from server.workspaces import repository


def _must_make_studies(services: Services, identity: Identity) -> Identity:
    with services.database.read() as session:
        if not repository.may_upload(session, identity):
            raise NotAllowed("This needs the role experimenter in a workspace; you have it in none.")
    return identity


def recognise_uploader(request: Request, services: Services) -> Identity:
    """The account behind an upload; NotSignedIn or NotAllowed where it may send none."""
    return _must_make_studies(services, WRITER(request, services, None, None))


def _uploader(services: ServicesDep, identity: Writer) -> Identity:
    return _must_make_studies(services, identity)


Uploader = Annotated[Identity, Depends(_uploader)]
"""May make studies somewhere, or edit one."""
