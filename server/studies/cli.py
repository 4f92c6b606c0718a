"""`server study` and `server link`: take studies in, open and close them, make links."""

from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from sqlalchemy.orm import Session

from experiments.checks import CHECK_CELL
from experiments.command_groups import command_group
from experiments.errors import InputError, counted, did_you_mean
from experiments.load import locate
from experiments.manifest import CheckClip, Clip, Manifest, read_manifest
from experiments.schema.canonical import definition_sha256
from server.accounts.audit import record
from server.accounts.identity import OPERATOR
from server.cli_common import migrated_services, out, stored_services
from server.context import Services
from server.core.settings import Settings
from server.core.values import now
from server.models import Link, Study, StudyVersion
from server.studies import repository
from server.studies.creation import (
    add_version,
    check_against_design,
    check_name,
    create_study,
    notes_of,
    planned_experiment,
    store_clips,
)
from server.studies.launch_checks import (
    CLIPS_WITHIN_S,
    clip_findings,
    clips_shown,
    refuse_if_live,
    refuse_unready,
)
from server.studies.links import (
    LinkKind,
    LinkOptions,
    general_links,
    link_url,
    make_links,
    numbered_labels,
    prepared_links,
    signing_of,
)
from server.studies.lookup import active_version, find_study, must_not_be_archived
from server.studies.repository import links_of
from server.studies.schemas import LaunchCheck
from server.studies.series import content_of, sizes_of, sizes_of_version

study_app = command_group("Studies on this server.")
link_app = command_group("Links for participants.")
STATUSES = ("draft", "pilot", "live", "closed")
KINDS: dict[str, LinkKind] = {"general": "general", "personal": "personal", "preview": "preview"}


def register(parent: typer.Typer) -> None:
    """Add `server study` and `server link` to the command line."""
    parent.add_typer(study_app, name="study")
    parent.add_typer(link_app, name="link")


@study_app.command("add")
def add(
    experiment: Annotated[str, typer.Argument(help="exp1 to exp3, a demo, or a TOML file.")],
    clips: Annotated[
        Path,
        typer.Option(
            help="Folder with manifest.json and its clips (`stimuli build`; for your own `stimuli manifest`)."
        ),
    ],
    name: Annotated[str, typer.Option(help="Name on this server. Default: the experiment's name.")] = "",
    open_: Annotated[bool, typer.Option("--open", help="Set it live and print its general link.")] = False,
    link: Annotated[bool, typer.Option(help="Print the link of a study that is set live.")] = True,
) -> None:
    """Add an experiment and its clips to the server, completely or not at all.

    Adding the same again changes nothing; a changed definition or changed clips create a new version.
    Example: server study add exp3 --clips out/exp3 --open
    """
    text = locate(experiment).read_text(encoding="utf-8")
    declared = planned_experiment(text, locate(experiment).name)
    manifest = read_manifest(clips)
    check_name(declared, manifest, clips)
    check_against_design(declared, manifest)
    with migrated_services() as services:
        new = store_clips(services.clips, manifest, clips)
        of_clips = _of_new_clips(services, name or declared.name, manifest, new=new, open_=open_)
        with services.database.write() as session:
            study = repository.study_called(session, name or declared.name)
            if study is not None:
                must_not_be_archived(study)
            study = study or create_study(session, name or declared.name, declared, None)
            version = _same_version(session, study, definition_sha256(declared), manifest)
            said = f"version {study.active_version}, nothing new"
            if version is None:
                version = add_version(session, study, text, declared, manifest, None)
                refuse_if_live(session, study, of_clips)
                said = f"version {version.number}, {counted(len(manifest.clips), 'clip')} ({new} new)"
            out.print(f"study {study.name}: {said}")
            for note in notes_of(declared, manifest, version):
                out.print(f"note: {note}", markup=False)
            if open_:
                _set_status(session, study, "live", of_clips)
                for group, url in _urls(services.settings, session, study) if link else ():
                    to = f" of the group {group}" if group else ""
                    out.print(f"link for participants{to}, once the server runs: {url}", soft_wrap=True)


def _of_new_clips(
    services: Services, name: str, manifest: Manifest, *, new: int, open_: bool
) -> list[LaunchCheck]:
    """What is wrong with clips that participants are about to get; nothing where they have them already."""
    with services.database.read() as session:
        study = repository.study_called(session, name)
        is_live = study is not None and study.status == "live"
    if not (new if is_live else open_):
        return []
    shown: list[Clip | CheckClip] = [*manifest.clips, *manifest.checks]
    return examined_clips(services, shown)


def examined_clips(services: Services, clips: Sequence[Clip | CheckClip]) -> list[LaunchCheck]:
    """What is wrong with clips. A command waits as long as it takes, unless a whole round gets nowhere."""
    faults, left = services.stored_clips.find_faults(clips, CLIPS_WITHIN_S)
    before = len(clips)
    while 0 < left < before:
        out.print(f"examining clips: {left} of {len(clips)} left")
        before = left
        faults, left = services.stored_clips.find_faults(clips, CLIPS_WITHIN_S)
    return clip_findings(faults, left)


def _same_version(session: Session, study: Study, sha256: str, manifest: Manifest) -> StudyVersion | None:
    """The active version, where it has this declaration and these clips."""
    if not study.active_version:
        return None
    version = active_version(session, study)
    known = {(clip.cell, clip.exemplar, clip.clip_sha256) for clip in version.clips}
    checks = {(CHECK_CELL, check.number, check.sha256) for check in manifest.checks}
    same = version.definition_sha256 == sha256 and known == content_of(manifest.clips) | checks
    return version if same and sizes_of(manifest) == sizes_of_version(version) else None


def _urls(settings: Settings, session: Session, study: Study) -> list[tuple[str, str]]:
    """The group and the address of each of the study's general links."""
    links = general_links(session, settings.key, study)
    return [(link.group_name, link_url(settings.public_url, settings.key, link.public_id)) for link in links]


def _set_status(
    session: Session, study: Study, status: str, of_clips: Sequence[LaunchCheck] = (), *, anyway: bool = False
) -> None:
    must_not_be_archived(study)
    if study.status == status:
        return
    passed_over: dict[str, str] = {}
    if status == "live":
        kinds = refuse_unready(session, study, of_clips, anyway=anyway)
        passed_over = {"anyway": ", ".join(kinds)} if anyway else {}
    record(session, None, "status changed", "study", study.name, old=study.status, new=status, **passed_over)
    study.status, study.revision = status, study.revision + 1
    if status in ("pilot", "live"):
        study.opened_at, study.closed_at = study.opened_at or now(), None
    if status == "closed":
        study.closed_at = now()


@study_app.command("status")
def set_status(
    study: Annotated[str, typer.Argument(help="Name of the study.")],
    status: Annotated[str, typer.Argument(help="draft, pilot, live or closed.")],
    anyway: Annotated[
        bool,
        typer.Option(help="Set it live even if clips are missing or damaged; the audit log records this."),
    ] = False,
) -> None:
    """Open or close a study. Before it is live, each of its clips is decoded.

    Example: server study status exp3 pilot
    """
    if status not in STATUSES:
        raise InputError(f"no status '{status}'{did_you_mean(status, STATUSES)}")
    with stored_services() as services:
        of_clips: list[LaunchCheck] = []
        if status == "live":
            with services.database.read() as session:
                clips = clips_shown(session, find_study(session, study, OPERATOR, "view"))
            of_clips = examined_clips(services, clips)
        with services.database.write() as session:
            known = find_study(session, study, OPERATOR, "view")
            _set_status(session, known, status, of_clips, anyway=anyway)
            out.print(f"study {known.name}: {known.status}")
        for finding in of_clips:
            out.print(f"note: {finding.text}", markup=False)


@study_app.command("list")
def list_studies() -> None:
    """List the studies with their status, version and runs.

    Example: server study list
    """
    with stored_services() as services, services.database.read() as session:
        table = Table("study", "status", "version", "runs", "complete", "title")
        counts = repository.runs_by_status(session)
        for study in repository.all_studies(session):
            by_status = {status: number for (ident, status), number in counts.items() if ident == study.id}
            numbers = (str(sum(by_status.values())), str(by_status.get("complete", 0)))
            table.add_row(study.name, study.status, str(study.active_version), *numbers, study.title)
        out.print(table if table.row_count else "no studies yet; add one by `server study add`")


@link_app.command("create")
def create(
    study: Annotated[str, typer.Argument(help="Name of the study.")],
    kind: Annotated[str, typer.Option(help="general, personal (one person) or preview.")] = "general",
    label: Annotated[
        str, typer.Option(help="Person or purpose of the link; for personal links the participant's name.")
    ] = "",
    count: Annotated[int, typer.Option(min=1, max=10_000, help="How many personal links.")] = 1,
    quota: Annotated[int | None, typer.Option(min=1, help="Maximum number of participants.")] = None,
    expires_hours: Annotated[float | None, typer.Option(min=0.0, help="Hours until it expires.")] = None,
    group: Annotated[
        str, typer.Option(help="Group of its participants, such as fast, if links assign groups.")
    ] = "",
) -> None:
    """Create a link, or many personal links, and print the addresses (with labels if there are several).

    Example: server link create exp3 --kind personal --label P --count 20 > links.csv
    """
    if kind not in KINDS:
        raise InputError(f"no kind of link '{kind}'{did_you_mean(kind, KINDS)}")
    if count > 1 and kind != "personal":
        raise InputError(
            "expected --count with --kind personal only; a general link serves any number of people"
        )
    expires = now() + timedelta(hours=expires_hours) if expires_hours is not None else None
    options = LinkOptions(KINDS[kind], group_name=group, quota=quota, expires_at=expires)
    with stored_services() as services:
        settings = services.settings
        rows = prepared_links(settings.key, options, numbered_labels(label, count) if count > 1 else [label])
        with services.database.write() as session:
            known = find_study(session, study, OPERATOR, "view")
            make_links(session, known, KINDS[kind], group, rows)
            record(session, None, "links created", "study", known.name, kind=kind, count=count)
    for row in rows:
        url = link_url(settings.public_url, settings.key, row["public_id"])
        out.print(f"{row['label']},{url}" if count > 1 else url)


@link_app.command("list")
def list_links(study: Annotated[str, typer.Argument(help="Name of the study.")]) -> None:
    """List the links of a study: kind, label, address.

    Example: server link list exp3
    """
    with stored_services() as services, services.database.read() as session:
        key, public_url = services.settings.key, services.settings.public_url
        for link in links_of(session, find_study(session, study, OPERATOR, "view")):
            out.print(f"{link.kind},{link.label},{link_url(public_url, key, link.public_id)}")


def _labelled_link(links: list[Link], label: str) -> Link:
    """The link with this label; InputError where there is none, or more than one."""
    named = [link for link in links if link.label == label]
    if len(named) != 1:
        near = did_you_mean(label, [link.label for link in links if link.label])
        raise InputError(f"expected the label of one link, '{label}' is that of {len(named) or 'none'}{near}")
    return named[0]


@link_app.command("secret")
def show_secret(
    study: Annotated[str, typer.Argument(help="Name of the study.")],
    name: Annotated[
        str | None, typer.Option(help="Name of the secret; that of the recruiter by default.")
    ] = None,
    link: Annotated[
        str | None, typer.Option(help="Label of a link with its own recruiter; the study's by default.")
    ] = None,
) -> None:
    """Print the secret that signs recruiters' URLs, and how to sign one; the audit log records this.

    Example: server link secret exp3 --link "summer school"
    """
    with stored_services() as services, services.database.write() as session:
        known = find_study(session, study, OPERATOR, "own")
        of_link = None if link is None else _labelled_link(links_of(session, known), link)
        told = signing_of(session, services.settings.key, known, name, None, of_link)
    out.print(f"secret: {told.secret}", soft_wrap=True, highlight=False)
    out.print(f"address: LINK?{told.query}", soft_wrap=True, highlight=False)
    out.print(f"in Python:\n{told.python}", soft_wrap=True, highlight=False, markup=False)
    out.print(f"by OpenSSL:\n{told.shell}", soft_wrap=True, highlight=False, markup=False)
    if not told.declared:
        out.print("The recruiter declares no signature_parameter: addresses are not checked.")
