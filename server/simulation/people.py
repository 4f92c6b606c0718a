"""Who takes part in a simulation: a link of its own, and raters who know the levels of every clip."""

from collections.abc import Callable

from experiments.errors import InputError
from experiments.trials.threshold.declaration import Threshold
from server.accounts.identity import OPERATOR
from server.context import Services
from server.simulation.observer import observer_of
from server.simulation.person import Rater
from server.studies.links import PURPOSE, create_link
from server.studies.lookup import active_version, find_study, must_not_be_archived
from server.studies.repository import clips_of_design
from server.tokens import derived_token


def link_and_raters(
    services: Services, name: str, observed: str = "", group: str = ""
) -> tuple[str, Callable[[int, int], Rater]]:
    """The token of a new link whose runs are simulated, and the maker of raters (by their number and a seed).

    Parameters
    ----------
    observed : str, optional
        The true function of a study of thresholds, as `server simulate --observer` takes it.
    group : str, optional
        Group of the link, where links decide on groups.
    """
    with services.database.write() as session:
        study = find_study(session, name, OPERATOR, "view")
        must_not_be_archived(study)
        version = active_version(session, study)
        rows = clips_of_design(session, version)
        blinks: dict[str, list[float]] = {row.clip_sha256: row.blinks_s or [] for row in rows}
        levels: dict[str, dict[str, str]] = {row.clip_sha256: row.levels for row in rows}
        link = create_link(
            session,
            services.settings.key,
            study,
            "general",
            label="simulation",
            synthetic=True,
            group_name=group,
        )
        experiment, observer = services.versions.get(session, version.id).experiment, None
        if isinstance(experiment.trial, Threshold):
            observer = observer_of(experiment, levels, observed)
        elif observed:
            raise InputError(f"--observer: expected a study of thresholds, got {experiment.trial.kind}")
        checks = {check["sha256"]: check["answer"] for check in version.manifest.get("checks", ())}
        token = derived_token(services.settings.key, PURPOSE, link.public_id)
    return token, lambda number, seed: Rater(number, seed, levels, observer, blinks, checks)
