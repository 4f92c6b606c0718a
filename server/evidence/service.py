"""The judgement on a stored run."""

from sqlalchemy.orm import Session

from experiments.assignment.checks import attention_by_block, motion_checks_by_block
from experiments.checks import CHECK_KINDS
from experiments.definition import Experiment
from experiments.trials import KINDS
from server.evidence import repository
from server.evidence.comparable import comparable
from server.evidence.signals import JudgedAnswer
from server.evidence.verdict import NOT_JUDGED, Judgement, judge
from server.models import StudyRun
from server.studies.lookup import definition_of


def judge_run(session: Session, run: StudyRun) -> Judgement:
    """The judgement on a run as it is stored; runs whose page was not asked for evidence are not judged."""
    if run.evidence != "asked" or run.erased_at is not None:
        return NOT_JUDGED
    rows = repository.answers(session, run)
    offered = _offered(run) if any(row.trial.kind == "attention" for row in rows) else 0
    answers = [_answer(row, offered) for row in rows]
    passed_over = [len(CHECK_KINDS[check].choices) for check in repository.checks_passed_over(session, run)]
    return judge(answers, refused=repository.has_refusals(session, run), passed_over=passed_over)


def guessed_throughout(experiment: Experiment) -> float:
    """How likely guesses are right in every attention and motion check that a run of a study has."""
    kinds = experiment.evidence.motion_checks.kinds
    fewest = min(len(CHECK_KINDS[kind].choices) for kind in kinds)
    questions, clips = sum(attention_by_block(experiment)), sum(motion_checks_by_block(experiment))
    offered = KINDS[experiment.trial.kind].check_choices(experiment)
    guesses: int = offered**questions * fewest**clips
    return 1 / guesses


def _offered(run: StudyRun) -> int:
    """How many answers an attention check of the run's study offers."""
    experiment = definition_of(run.version)
    return KINDS[experiment.trial.kind].check_choices(experiment)


def _answer(row: repository.StoredAnswer, offered: int) -> JudgedAnswer:
    evidence, trial = row.evidence, row.trial
    response, choices = comparable(row.rating.payload), 0
    if trial.kind == "attention":
        response, choices = KINDS[row.rating.kind].check_response(row.rating.payload), offered
    if trial.kind == "check":
        response = row.rating.payload.get("check")
    given = (evidence.interaction if evidence else None) or {}
    unchecked = evidence is not None and evidence.digest is not None and evidence.digest_right is None
    return JudgedAnswer(
        trial_index=trial.trial_index,
        play=row.rating.play,
        part=trial.kind,
        response=response,
        expected=trial.expected_response,
        rt=row.rating.rt,
        clip_ms=evidence.clip_ms if evidence else 0.0,
        needs_digest=response is not None and row.has_clip and not unchecked,
        received_at=evidence.received_at if evidence else row.rating.saved_at,
        issued_at=evidence.issued_at if evidence else None,
        digest_right=evidence.digest_right if evidence else None,
        late=bool(evidence and evidence.late),
        presses=given.get("presses"),
        trusted=given.get("trusted"),
        press_ms=given.get("press_ms"),
        choices=len(CHECK_KINDS[row.check].choices) if row.check else choices,
        void=row.check is not None and row.rating.verdict == "failed",
        other_way=trial.kind == "check" and bool(row.rating.payload.get("other_way")),
    )
