"""What an experimenter should know before a study goes live, and what the server refuses to open.

The same checks hold for whatever reaches participants later: a new version of a live study, and its settings.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from sqlalchemy.orm import Session

from experiments.declaration.experiment import Experiment
from experiments.level_leaks import reported_leaks
from experiments.manifest import Manifest
from experiments.wording import silent_on_flicker, suggested_sentence, unfilled_texts, untranslated
from server.accounts.identity import Identity
from server.core.errors import Conflict
from server.models import Study, StudyVersion
from server.participation.evidence import ENOUGH_BY_CHANCE
from server.participation.judgement import guessed_throughout
from server.participation.recruiter import Recruiter, stored_recruiter
from server.studies import repository
from server.studies.lookup import active_version, definition_of, find_study, version_numbered
from server.studies.schemas import LaunchCheck

MAX_TEXTS_NAMED = 3


class NotReady(Conflict):
    """A launch check that blocks has found something."""

    code = "not_ready"


class LaunchState(NamedTuple):
    """What participants of a live study meet: its declaration, clips, recruiters and links."""

    version: StudyVersion
    experiment: Experiment
    recruiter: Recruiter | None
    of_links: list[Recruiter]
    has_personal_links: bool


Check = Callable[[LaunchState], Iterator[LaunchCheck]]


def launch_checks(session: Session, name: str, identity: Identity) -> list[LaunchCheck]:
    """What speaks against opening the active version of a study, blocking findings first."""
    study = find_study(session, name, identity, "view")
    launch = _to_launch(session, study, active_version(session, study))
    findings = [finding for check in (*_BLOCKING, *_ADVISING) for finding in check(launch)]
    return sorted(findings, key=lambda finding: not finding.blocks)


def refuse_unready(session: Session, study: Study) -> None:
    """NotReady, with the sentences of every blocking check, where the study must not be live as it is."""
    if sentences := _blocking_sentences(_to_launch(session, study, active_version(session, study))):
        raise NotReady(" ".join(sentences))


def refuse_if_live(session: Session, study: Study) -> None:
    """As `refuse_unready`, of a new version of a study that is live; what was live before stays possible."""
    if study.status != "live":
        return
    version = active_version(session, study)
    found_before: list[str] = []
    if version.number > 1:
        before = version_numbered(session, study, version.number - 1)
        found_before = _blocking_sentences(_to_launch(session, study, before))
    sentences = _blocking_sentences(_to_launch(session, study, version))
    if new := [sentence for sentence in sentences if sentence not in found_before]:
        raise NotReady(" ".join(new))


def _blocking_sentences(launch: LaunchState) -> list[str]:
    return [finding.text for check in _BLOCKING for finding in check(launch) if finding.blocks]


def refuse_recruiter(study: Study, recruiter: Recruiter | None, page: str) -> None:
    """NotReady where a live study gets this recruiter, set on `page`, and nobody could be paid by it."""
    if study.status == "live" and recruiter is not None and _code_is_random(recruiter):
        raise NotReady(_CODE_NEEDED.format(page=page))


def _to_launch(session: Session, study: Study, version: StudyVersion) -> LaunchState:
    return LaunchState(
        version,
        definition_of(version),
        stored_recruiter(study.recruiter) if study.recruiter else None,
        [stored_recruiter(declared) for declared in repository.recruiters_of_links(session, study)],
        repository.has_personal_links(session, study),
    )


def _placeholders(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Texts that still have marks such as [Title]."""
    for text in unfilled_texts(launch.experiment):
        yield LaunchCheck(kind="placeholders", blocks=text.certain, text=str(text))


def _completion_codes(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Prolific knows its own code alone; a random one pays nobody."""
    recruiters = [(launch.recruiter, "Settings")] if launch.recruiter else []
    recruiters += [(recruiter, "Links") for recruiter in launch.of_links]
    for recruiter, page in recruiters:
        if _code_is_random(recruiter):
            text = _CODE_NEEDED.format(page=page)
            yield LaunchCheck(kind="completion_code", blocks=True, text=text)
            return


_CODE_NEEDED = (
    "Recruiting through Prolific needs the completion code of the Prolific study, but none is set. "
    "Participants would get a random code that Prolific does not accept. Enter it under {page}."
)


def _code_is_random(recruiter: Recruiter) -> bool:
    fixed = recruiter.code_complete or (recruiter.redirect_url and "{code}" not in recruiter.redirect_url)
    return recruiter.kind == "prolific" and not fixed


def _levels_told_apart(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Levels that raters can recognize by something other than the factor."""
    manifest = Manifest.model_validate(launch.version.manifest)
    for sentence in reported_leaks(manifest.clips):
        yield LaunchCheck(
            kind="levels_told_apart", blocks=False, text=f"{sentence[:1].upper()}{sentence[1:]}."
        )


def _translations(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Texts that participants read in another language than they chose."""
    first = launch.experiment.languages[0]
    for language, paths in untranslated(launch.experiment).items():
        named = ", ".join(paths[:MAX_TEXTS_NAMED])
        more = f" and {len(paths) - MAX_TEXTS_NAMED} more" if len(paths) > MAX_TEXTS_NAMED else ""
        yield LaunchCheck(
            kind="translations",
            blocks=False,
            text=f"Participants who choose the language {language} read {named}{more} in {first}: "
            f"{'this text has' if len(paths) == 1 else 'these texts have'} no translation.",
        )


def _recruiter(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Without a recruiter and without personal links nothing says who a participant is."""
    if launch.recruiter is None and not launch.of_links and not launch.has_personal_links:
        yield LaunchCheck(
            kind="recruiter",
            blocks=False,
            text=(
                "No recruiter is set, so one person can take part twice. To recruit through Prolific, "
                "SONA or MTurk, choose it under Settings first. Until then, links from these services are "
                "refused."
            ),
        )
    if launch.recruiter is not None and launch.recruiter.kind == "sona" and not launch.recruiter.redirect_url:
        yield LaunchCheck(
            kind="recruiter",
            blocks=False,
            text=(
                "SONA grants credit through its completion URL, but none is set. Enter SONA's completion "
                "URL under Settings, or grant credit manually."
            ),
        )


def _flicker(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Motion checks of flickering dots that the consent does not mention."""
    if languages := silent_on_flicker(launch.experiment):
        yield LaunchCheck(
            kind="flicker",
            blocks=False,
            text="Motion checks show flickering dots, but the consent text does not mention flicker "
            f"({', '.join(languages)}). Some people are sensitive to flicker. Add a sentence such as "
            f'"{suggested_sentence(languages[0])}"',
        )


def _person_checks(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Recruited participants, and too few checks to tell people from programs."""
    if (launch.recruiter or launch.of_links) and guessed_throughout(launch.experiment) >= ENOUGH_BY_CHANCE:
        yield LaunchCheck(
            kind="person_checks",
            blocks=False,
            text=(
                "Participants are recruited online, but the study has too few attention and motion checks "
                "to distinguish people from programs. No run can be rated likely to be a person. Turn on "
                "online recruitment under Build, Checks and exclusions. It adds two motion checks and one "
                "attention question."
            ),
        )


_BLOCKING: tuple[Check, ...] = (_placeholders, _completion_codes)
"""Fast: they are asked in the transaction that opens or changes the study."""
_ADVISING: tuple[Check, ...] = (
    _recruiter,
    _person_checks,
    _flicker,
    _translations,
    _levels_told_apart,
)
