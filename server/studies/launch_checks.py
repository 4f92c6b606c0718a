"""What an experimenter should know before a study goes live, and what the server refuses to open.

The same checks hold for whatever reaches participants later: a new version of a live study, and its settings.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from sqlalchemy.orm import Session

from experiments.declaration.experiment import Experiment
from experiments.errors import counted
from experiments.kinds import KINDS, expected_minutes
from experiments.level_leaks import reported_leaks
from experiments.manifest import CheckClip, Clip, Manifest
from experiments.wording import (
    LEAST_HOURLY_PAY,
    MINUTES_TOLERANCE,
    place_in_words,
    silent_on_contact,
    silent_on_flicker,
    stated_minutes,
    stated_pay,
    suggested_sentence,
    unfilled_texts,
    untranslated,
)
from server.accounts.identity import Identity
from server.core.errors import Conflict
from server.models import Study, StudyVersion
from server.participation.evidence import ENOUGH_BY_CHANCE
from server.participation.judgement import guessed_throughout
from server.participation.recruiter import Recruiter, stored_recruiter
from server.studies import repository
from server.studies.lookup import active_version, definition_of, find_study, version_numbered
from server.studies.schemas import LaunchCheck, LaunchPage
from server.transcoding.preparing import ClipFault

CLIPS_WITHIN_S = 60.0
"""How long opening a study waits until its clips are examined."""


class NotReady(Conflict, code="not_ready"):
    """A launch check that blocks has found something."""


class LaunchState(NamedTuple):
    """What participants of a live study meet: its declaration, clips, recruiters and links."""

    study: Study
    version: StudyVersion
    experiment: Experiment
    recruiter: Recruiter | None
    of_links: list[Recruiter]
    has_personal_links: bool
    is_tried: bool
    """Whether somebody completed this version as a preview, in a pilot or live."""

    @property
    def consents(self) -> dict[str, str]:
        """Language -> consent text."""
        return {one: self.experiment.texts[one].consent for one in self.experiment.languages}


Check = Callable[[LaunchState], Iterator[LaunchCheck]]


def launch_checks(session: Session, name: str, identity: Identity) -> list[LaunchCheck]:
    """What its declaration, clips and recruiter say against opening the active version of a study."""
    study = find_study(session, name, identity, "view")
    launch = _to_launch(session, study, active_version(session, study))
    return [finding for check in (*_BLOCKING, *_ADVISING) for finding in check(launch)]


def refuse_unready(
    session: Session, study: Study, of_clips: Sequence[LaunchCheck] = (), *, anyway: bool = False
) -> list[str]:
    """NotReady, with the sentences of every blocking check, where the study must not be live as it is.

    Parameters
    ----------
    session : Session
    study : Study
    of_clips : sequence of LaunchCheck, optional
        What `clip_findings` gave, found before the transaction.
    anyway : bool, optional
        Open it in spite of what blocks in `of_clips`; other checks are not passed over.

    Returns
    -------
    passed_over : list of str
        Kinds of the findings that were passed over.
    """
    launch = _to_launch(session, study, active_version(session, study))
    blocking = [finding for finding in of_clips if finding.blocks]
    sentences = _blocking_sentences(launch) + [finding.text for finding in blocking if not anyway]
    if sentences:
        raise NotReady(" ".join(sentences))
    return [finding.kind for finding in blocking]


def refuse_if_live(session: Session, study: Study, of_clips: Sequence[LaunchCheck] = ()) -> None:
    """As `refuse_unready`, of a new version of a study that is live; what was live before stays possible."""
    if study.status != "live":
        return
    version = active_version(session, study)
    found_before: list[str] = []
    if version.number > 1:
        before = version_numbered(session, study, version.number - 1)
        found_before = _blocking_sentences(_to_launch(session, study, before))
    sentences = _blocking_sentences(_to_launch(session, study, version))
    sentences += [finding.text for finding in of_clips if finding.blocks]
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
        study,
        version,
        definition_of(version),
        stored_recruiter(study.recruiter) if study.recruiter else None,
        [stored_recruiter(declared) for declared in repository.recruiters_of_links(session, study)],
        repository.has_personal_links(session, study),
        repository.is_completed(session, version),
    )


def _placeholders(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Texts that still have marks such as [Title]."""
    for text in unfilled_texts(launch.experiment):
        yield LaunchCheck(
            kind="placeholders", blocks=text.certain, text=str(text), page="build", path=text.path
        )


def _completion_codes(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Prolific knows its own code alone; a random one pays nobody."""
    recruiters = [(launch.recruiter, "Settings")] if launch.recruiter else []
    recruiters += [(recruiter, "Links") for recruiter in launch.of_links]
    for recruiter, page in recruiters:
        if _code_is_random(recruiter):
            text = _CODE_NEEDED.format(page=page)
            where: LaunchPage = "links" if page == "Links" else "settings"
            yield LaunchCheck(kind="completion_code", blocks=True, text=text, page=where, path="recruitment")
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
        yield LaunchCheck(kind="levels_told_apart", blocks=False, text=_as_sentence(sentence), page="clips")


def _doubtful_trial(launch: LaunchState) -> Iterator[LaunchCheck]:
    """A declared trial that is possible but most likely a mistake."""
    if doubt := KINDS[launch.experiment.trial.kind].doubt(launch.experiment):
        path, _, said = doubt.partition(": ")
        text = _as_sentence(said)
        yield LaunchCheck(kind="doubtful_trial", blocks=False, text=text, page="build", path=path)


def _as_sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _translations(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Texts that participants read in another language than they chose."""
    first = launch.experiment.languages[0]
    for language, paths in untranslated(launch.experiment).items():
        places = [place_in_words(launch.experiment, path) for path in paths]
        yield LaunchCheck(
            kind="translations",
            blocks=False,
            text=f"Participants who choose the language {language} read {', '.join(places)} in {first}: "
            f"{'this text has' if len(paths) == 1 else 'these texts have'} no translation.",
            page="build",
            path=paths[0],
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
            page="settings",
            path="recruitment",
        )
    if launch.recruiter is not None and launch.recruiter.kind == "sona" and not launch.recruiter.redirect_url:
        yield LaunchCheck(
            kind="recruiter",
            blocks=False,
            text=(
                "SONA grants credit through its completion URL, but none is set. Enter SONA's completion "
                "URL under Settings, or grant credit manually."
            ),
            page="settings",
            path="recruitment",
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
            page="build",
            path=f"texts.{languages[0]}.consent",
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
            page="build",
            path="evidence",
        )


def _contact(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Consent texts that name nobody to turn to."""
    if languages := silent_on_contact(launch.experiment):
        yield _of_consent(
            "contact",
            languages[0],
            f"The consent text ({', '.join(languages)}) has no e-mail address, telephone number or link. "
            "Participants need a contact for questions and for withdrawing their data. Add one.",
        )


def _time(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Consent texts that say nothing of the time, or another time than the design takes."""
    expected = expected_minutes(launch.experiment)
    expected_time = counted(max(1, round(expected)), "minute")
    for language, text in launch.consents.items():
        stated = stated_minutes(text)
        if stated is None:
            what = f"does not say how long participation takes. Expected: about {expected_time}. Add it."
        elif expected > MINUTES_TOLERANCE * stated or stated > MINUTES_TOLERANCE * max(expected, 5):
            what = (
                f"says {stated} minutes, but the design takes about {expected_time} without forms and "
                "calibration. Correct the text or the design."
            )
        else:
            continue
        yield _of_consent("time", language, f"The consent text ({language}) {what}")
        return


def _pay(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Pay that is not stated although people are recruited for it, or that is too low for the time."""
    minutes = expected_minutes(launch.experiment)
    time = counted(max(1, round(minutes)), "minute")
    paying = any(
        one is not None and one.kind in ("prolific", "mturk") for one in (launch.recruiter, *launch.of_links)
    )
    for language, text in launch.consents.items():
        pay = stated_pay(text)
        if pay is None:
            if paying:
                what = "The consent text does not say what participants are paid. Add the amount."
                yield _of_consent("pay", language, what)
                return
            continue
        hourly = pay.amount if pay.hourly else pay.amount * 60 / max(minutes, 1)
        if hourly < LEAST_HOURLY_PAY[pay.sign]:
            yield _of_consent(
                "pay",
                language,
                f"{pay.sign}{pay.amount:.2f} for about {time} is {pay.sign}{hourly:.2f} per hour. "
                f"Recruiters expect at least {pay.sign}{LEAST_HOURLY_PAY[pay.sign]:.0f} per hour. "
                "Raise the pay or shorten the design.",
            )
            return


def _of_consent(kind: str, language: str, text: str) -> LaunchCheck:
    return LaunchCheck(kind=kind, blocks=False, text=text, page="build", path=f"texts.{language}.consent")


def _clip_size(launch: LaunchState) -> Iterator[LaunchCheck]:
    """Clips shown pixel by pixel that are larger than the smallest window in which the study begins."""
    manifest, display = Manifest.model_validate(launch.version.manifest), launch.experiment.display
    scaled = display.calibrate != "off"
    if scaled and manifest.inter_ocular_px:
        return
    unsized = [clip for clip in manifest.clips if not (scaled and clip.width_mm)]
    width = max((clip.width_px for clip in unsized), default=0)
    height = max((clip.height_px for clip in unsized), default=0)
    if width > display.minimum_width_px or height > display.minimum_height_px:
        yield LaunchCheck(
            kind="clip_size",
            blocks=False,
            text=(
                f"Clips are up to {width} x {height} pixels, but the study starts in windows from "
                f"{display.minimum_width_px} x {display.minimum_height_px} pixels, where they are scaled "
                "down or cut off. Increase the minimum width and height, or use smaller clips."
            ),
            page="build",
            path="display.minimum_width_px",
        )


def _running(launch: LaunchState) -> Iterator[LaunchCheck]:
    """A study that nobody can begin, or that does not stop by itself."""
    study, planned = launch.study, launch.experiment.participants
    if study.paused:
        text = "The study is paused, so nobody can begin. Turn the pause off."
        yield LaunchCheck(kind="paused", blocks=False, text=text, page="settings", path="running")
    if study.quota is None:
        text = (
            f"No limit is set, so the study goes on until you close it. The design plans {planned} "
            "participants. Set the number of complete runs after which it closes."
        )
        yield LaunchCheck(kind="quota", blocks=False, text=text, page="settings", path="running")
    elif study.quota < planned:
        text = (
            f"The study closes after {study.quota} complete runs, but the design plans {planned} "
            "participants. Correct one of them."
        )
        yield LaunchCheck(kind="quota", blocks=False, text=text, page="settings", path="running")


def _tried(launch: LaunchState) -> Iterator[LaunchCheck]:
    """A version that nobody has gone through."""
    if not launch.is_tried:
        text = (
            f"Nobody has completed version {launch.version.number} yet, not even as a preview. "
            "Complete it once as a participant. Preview answers are not part of the results and "
            "are deleted later."
        )
        yield LaunchCheck(kind="not_tried", blocks=False, text=text, page="preview")


# Clips as the store holds them. They are examined outside of the transaction: decoding takes time.


def clips_shown(session: Session, study: Study) -> list[Clip | CheckClip]:
    """Every clip that participants of the active version may see, each file once."""
    manifest = Manifest.model_validate(active_version(session, study).manifest)
    shown: list[Clip | CheckClip] = [*manifest.clips, *manifest.checks]
    return list({clip.sha256: clip for clip in shown}.values())


_CLIP_WORDS = {
    "missing": ("is missing on the server", "are missing on the server", "Upload it again."),
    "undecodable": (
        "does not play in the participant page",
        "do not play in the participant page",
        "Export it again as H.264 in MP4.",
    ),
    "different": ("is not as stored", "are not as stored", "Upload it again."),
    "other_rate": (
        "plays at another rate than recorded",
        "play at another rate than recorded",
        "Is this intended?",
    ),
    "codec": ("does not play in every browser", "do not play in every browser", "Export it as H.264."),
}
_BLOCKING_FAULTS = ("missing", "undecodable", "different")


def clip_findings(faults: Sequence[ClipFault], left: int = 0) -> list[LaunchCheck]:
    """One line of the checklist per kind of fault; one more for clips that there was no time to examine."""
    findings = []
    for kind, (one, several, todo) in _CLIP_WORDS.items():
        hits = [f"{fault.file} ({fault.detail})" for fault in faults if fault.kind == kind]
        if hits:
            what = one if len(hits) == 1 else several
            text = f"{counted(len(hits), 'clip')} {what}: {', '.join(hits)}. {todo}"
            findings.append(_of_clips(f"clip_{kind}", text, blocks=kind in _BLOCKING_FAULTS))
    if left:
        text = f"The server has not yet examined {counted(left, 'clip')}. Try again in a minute."
        findings.append(_of_clips("clips_not_examined", text, blocks=True))
    return findings


def _of_clips(kind: str, text: str, *, blocks: bool) -> LaunchCheck:
    return LaunchCheck(kind=kind, blocks=blocks, text=text, page="clips")


_BLOCKING: tuple[Check, ...] = (_placeholders, _completion_codes)
"""Fast: they are asked in the transaction that opens or changes the study."""
_ADVISING: tuple[Check, ...] = (
    _recruiter,
    _person_checks,
    _flicker,
    _contact,
    _time,
    _pay,
    _translations,
    _doubtful_trial,
    _levels_told_apart,
    _clip_size,
    _running,
    _tried,
)
