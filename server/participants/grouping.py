"""Into which groups a run may come: by turn, by its link, or by an answer; and which have places left."""

from collections.abc import Mapping
from datetime import timedelta
from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from experiments.assignment.groups import names
from experiments.definition import Experiment
from server.participants import places_repository
from server.participants.refusals import GroupRefused

if TYPE_CHECKING:
    from server.models import Link

PARAMETER = "group"
COUNTED_ORIGINS = ("participant", "pilot")


def check_parameter(experiment: Experiment, link: "Link", query: Mapping[str, str]) -> None:
    """GroupRefused where the address asks for a group that its link is not for."""
    asked = query.get(PARAMETER)
    if asked is None or len(names(experiment)) < 2 or asked == link.group_name:
        return
    raise GroupRefused(
        f"Expected an address without `{PARAMETER}`, got `{PARAMETER}={asked[:60]}`: nobody chooses their "
        "group; please open the link as you were given it."
    )


def leads_nowhere(experiment: Experiment, link: "Link") -> bool:
    """True where links decide the group and this one, meant for people, is for none that there is."""
    by_link = experiment.groups.by == "link" and link.kind != "preview" and not link.synthetic
    return by_link and link.group_name not in names(experiment)


def open_turns(
    session: Session, experiment: Experiment, version_id: int, origin: str, name: str = ""
) -> list[int]:
    """The groups with places left, by their turns: all of them, or the one called `name` if it has.

    Parameters
    ----------
    name : str, optional
        Of the group that link or answer decided; empty where groups take turns.
    """
    every = names(experiment)
    turns = [turn for turn, known in enumerate(every) if name in ("", known)]
    quotas = experiment.groups.quotas
    if not quotas or origin not in COUNTED_ORIGINS:
        return turns
    lease = timedelta(minutes=experiment.session.lease_minutes)
    taken = places_repository.places_by_group(session, version_id, origin, lease)
    return [turn for turn in turns if every[turn] not in quotas or taken[every[turn]] < quotas[every[turn]]]
