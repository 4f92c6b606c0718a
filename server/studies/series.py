"""The data series of a study: versions that measure the same, and whose answers may be pooled."""

from sqlalchemy.orm import Session

from experiments.definition import Experiment
from experiments.manifest import Manifest
from experiments.schema.difference import changes_what_is_measured, difference
from server.errors import NotFound
from server.models import Study, StudyVersion
from server.studies import repository
from server.studies.definition_schemas import ChangeOut, JudgedEdit
from server.studies.lookup import active_version, definition_of
from server.studies.schemas import SeriesOut


def series_of(session: Session, study: Study) -> list[SeriesOut]:
    """Every series of a study, oldest first, with its versions and its runs by origin."""
    runs: dict[int, dict[str, int]] = {}
    for series, origin, count in repository.runs_by_series(session, study):
        runs.setdefault(series, {})[origin] = count
    return [
        SeriesOut(number=series, versions=numbers, name=name_of(series, numbers), runs=runs.get(series, {}))
        for series, numbers in sorted(repository.versions_by_series(session, study).items())
    ]


def name_of(series: int, versions: list[int]) -> str:
    """A series in words: `series 2 (versions 3, 4)`."""
    word = "version" if len(versions) == 1 else "versions"
    return f"series {series} ({word} {', '.join(map(str, versions))})"


def version_of_series(session: Session, study: Study, series: int | None) -> StudyVersion:
    """The newest version of a series, whose scale and factors are those of all its answers.

    Where no series is given it is that of the active version.
    """
    if series is None:
        return active_version(session, study)
    version = repository.newest_of_series(session, study, series)
    if version is None:
        known = repository.versions_by_series(session, study).items()
        there = ", ".join(name_of(number, versions) for number, versions in sorted(known))
        raise NotFound(f"Study '{study.name}' has no data series {series}; there is {there}.")
    return version


def series_for(study: Study, experiment: Experiment, manifest: Manifest) -> int:
    """The series of a further version: the latest whose versions all measure the same by the same clips.

    Where there is none, a new series begins. One version is not enough: a form may be new to an older version
    and another form than that of a newer one.
    """
    clips = {(clip.cell, clip.exemplar, clip.sha256) for clip in manifest.clips}
    by_series: dict[int, list[StudyVersion]] = {}
    for version in study.versions:
        by_series.setdefault(version.series, []).append(version)
    for series in dict.fromkeys(version.series for version in reversed(study.versions)):
        if all(_measures_the_same(version, experiment, clips) for version in reversed(by_series[series])):
            return series
    return max(by_series, default=0) + 1


def _measures_the_same(
    version: StudyVersion, experiment: Experiment, clips: set[tuple[str, int, str]]
) -> bool:
    known = {(clip.cell, clip.exemplar, clip.clip_sha256) for clip in version.clips if clip.cell}
    return known == clips and not changes_what_is_measured(difference(definition_of(version), experiment))


def judged(session: Session, study: Study, experiment: Experiment) -> JudgedEdit:
    """What saving this definition as a further version would do to the answers that are stored."""
    present = active_version(session, study)
    series = series_for(study, experiment, Manifest.model_validate(present.manifest))
    runs = repository.run_count_of_series(session, study, present.series)
    known = {version.series for version in study.versions}
    return JudgedEdit(
        changes=[
            ChangeOut(path=change.path, effect=change.effect, text=str(change))
            for change in difference(definition_of(present), experiment)
        ],
        series=series,
        present_series=present.series,
        runs=runs,
        begins_series=bool(runs) and series not in known,
    )
