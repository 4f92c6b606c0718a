"""`analysis check-paper`, `analysis verify` and `analysis replicate`."""

from dataclasses import asdict
from datetime import date
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from analysis.commands.output import (
    JsonOption,
    progress_spinner,
    save_json,
    show_tables,
    show_text,
)
from experiments.files import check_folder
from table_files import counted

if TYPE_CHECKING:
    from analysis.capsule import FileComparison
    from experiments.capsule import Capsule


# `analysis check-paper`: what printed figures and sentences say about themselves.


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command(name="check-paper")(check_paper)
    app.command(name="verify")(verify)
    app.command(name="replicate")(replicate)


def check_paper(
    file: Annotated[
        Path | None,
        typer.Argument(
            help=(
                "A manuscript or report (HTML, TeX, DOCX, PDF, Markdown, text), or a TOML file of printed "
                "figures. Default: the shipped figures of the paper."
            )
        ),
    ] = None,
    json: Annotated[Path | None, typer.Option(help="Also write the findings to this JSON file.")] = None,
) -> None:
    """Check the statistics printed in a paper: p, df and effect sizes; SE or SD; means that fit together.

    Examples:

      analysis check-paper manuscript.docx

      analysis check-paper out/analysis/exp1/report.html --json findings.json

      analysis check-paper figures.toml

    Exit code 1 if a statistic or figure of FILE is inconsistent.
    The shipped analysis/paper/published/FIGURES.toml shows the format of figures.
    """
    from analysis.paper.printed import SHIPPED

    if file is None or file.suffix.lower() == ".toml":
        wrong = _check_figures(file or SHIPPED, json)
    else:
        wrong = _check_document(file, json)
    # Those of the shipped figures are known: without a file, this shows what the check finds.
    if wrong and file is not None:
        raise typer.Exit(1)


def _check_document(file: Path, json: Path | None) -> int:
    """Print what a manuscript's statistics say; how many do not fit."""
    from analysis.paper.document import read_document
    from analysis.paper.statistics import check_text
    from analysis.report.formats import wrap
    from experiments.files import json_text, whole_file

    result = check_text(read_document(file))
    if json is not None:
        counts = {"read": len(result.statistics), "checked": result.n_checked, "wrong": result.n_wrong}
        with whole_file(json) as temporary:
            temporary.write_text(json_text({"file": file.name, **counts, **asdict(result)}), encoding="utf-8")
    typer.echo(
        f"{file.name}: {len(result.statistics)} statistics read, {result.n_checked} checked, "
        f"{result.n_wrong} inconsistent, {len(result.unread)} could not be read"
    )
    for statistic in result.statistics:
        for problem in statistic.problems:
            grave = " (one is significant, the other is not)" if statistic.verdict == "decision" else ""
            typer.echo("\n".join(wrap(f"- {statistic.text}: {problem}{grave}")))
    for fragment in result.unread:
        typer.echo("\n".join(wrap(f"- could not be read: {fragment}")))
    return result.n_wrong


def _check_figures(figures: Path, json: Path | None) -> int:
    """Print what printed figures say of each other; how many problems they have, notes not counted."""
    from analysis.paper import check as checks
    from analysis.paper.printed import load_figures
    from analysis.report.formats import wrap
    from experiments.files import json_text, whole_file

    paper = load_figures(figures)
    findings = checks.check_paper(paper)
    if json is not None:
        with whole_file(json) as temporary:
            temporary.write_text(json_text([asdict(finding) for finding in findings]), encoding="utf-8")
    typer.echo("\n".join(wrap(f"{paper.title}. {paper.source}")))
    for study in paper.study:
        typer.echo(f"\n{study.name}, N = {study.participants}")
        mine = [finding for finding in findings if finding.study == study.name]
        for finding in mine or []:
            text = f"- {finding.kind}, {finding.check}: {finding.about}: {finding.why}"
            typer.echo("\n".join(wrap(text)))
        if not mine:
            typer.echo("- nothing found")
    grave = sum(finding.kind != "note" for finding in findings)
    typer.echo(f"\n{grave} problems and {len(findings) - grave} notes")
    return grave


# `analysis verify`: is a capsule whole, and does its report come out again?


def verify(
    capsule: Annotated[
        Path, typer.Argument(help="The zip of a capsule, or the folder it was unpacked into.")
    ],
    report: Annotated[
        bool, typer.Option(help="Regenerate the report, or only compare every file with its hash.")
    ] = True,
) -> None:
    """Verify a capsule: check every file against the list, and regenerate the report from its data.

    Every table is rebuilt as printed. Under the same versions, every figure is the same byte for byte.
    Differences are listed with the versions that differ. Changes that a later release made on purpose are
    listed with their reason. Exit code 0: all equal, or only figures differ under other versions. 1: the
    report differs. 2: a file was changed, is missing, or does not belong to the capsule.

    Examples:

      analysis verify exp3-capsule.zip

      analysis verify exp3-capsule.zip --no-report
    """
    from experiments.capsule import REPORT_FOLDER, differences, open_capsule, present_software

    with TemporaryDirectory(prefix="capsule-") as temporary, progress_spinner("verifying") as say:
        files, work = Path(temporary) / "files", Path(temporary) / "work"
        files.mkdir()
        work.mkdir()
        say("hashes")
        listed, folder = open_capsule(capsule, files)
        typer.echo(f"capsule of the study {listed.study}, made {listed.made}, sha256 {listed.sha256}")
        typer.echo(f"{counted(len(listed.files), 'file')}, all as listed")
        if not report:
            return
        from analysis.capsule import compare_reports, rebuild

        again = rebuild(listed.report, folder, work, say)
        made = date.fromisoformat(listed.made[:10])
        compared = compare_reports(listed.report.rebuilt, folder / REPORT_FOLDER, again, made)
        _check_software(listed, folder)
    versions = differences(listed.software, present_software())
    _tell(compared, versions)


def _check_software(listed: "Capsule", folder: Path) -> None:
    """The versions of the list are those of the capsule's other file of them; else one was changed alone."""
    import json

    from experiments.capsule import SOFTWARE_FILE
    from experiments.errors import InputError

    path = folder / SOFTWARE_FILE
    if not path.is_file() or json.loads(path.read_text(encoding="utf-8")) != listed.software.model_dump(
        mode="json"
    ):
        raise InputError(
            f"{SOFTWARE_FILE}: expected the versions in the list, got others; the versions that made the "
            "report are unknown"
        )


def _tell(compared: "list[FileComparison]", versions: list[str]) -> None:
    """Say what differs; exit code 1 where a table does, or a figure under the same versions."""
    same = sum(one.kind == "same" for one in compared)
    typer.echo(f"regenerated report: {same} of {len(compared)} files are the same byte for byte")
    for one in compared:
        if one.kind != "same":
            typer.echo(f"{one.name}: {one.said}")
    if same == len(compared):
        typer.echo("verified: every table is as printed, every figure is the same byte for byte")
        return
    said = "; ".join(versions) or "none, the software is the same"
    typer.echo(f"versions that differ, according to the capsule: {said}")
    if any(one.kind == "table" for one in compared):
        typer.echo("NOT verified: tables differ", err=True)
        raise typer.Exit(1)
    if any(one.kind == "figure" for one in compared) and not versions:
        typer.echo("NOT verified: figures differ under the same versions", err=True)
        raise typer.Exit(1)
    typer.echo("verified: every table is as printed; the differences are due to other versions or processors")


# `analysis replicate`: published studies rebuilt from their raw files.


def replicate(
    context: typer.Context,
    study: Annotated[
        list[str] | None,
        typer.Argument(help="Shipped studies, or folders with a study.toml. Default: every shipped study."),
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Folder with your copy of files that may not be shipped.")
    ] = None,
    slow: Annotated[bool, typer.Option("--slow", help="Add bootstraps and other slow analyses.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="Write comparison.csv and comparison.md, every number, to this folder."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Rebuild published studies from their raw files, and compare every printed number.

    A study is a folder whose study.toml declares the files with their SHA-256, the commands, and the
    printed numbers. Exit code 1 if a number differs and study.toml gives no reason.

    Examples:

      analysis replicate

      analysis replicate hdr-vdc-pairs --slow --out comparison

      analysis replicate p1203-acr --data downloads/p1203
    """
    from analysis.replication import (
        differences_table,
        replicate_study,
        rows_table,
        shipped_studies,
        studies_table,
    )
    from analysis.report.formats import as_markdown

    if out is not None:
        check_folder(out)
    with progress_spinner("replicating") as say:
        results = []
        run = partial(context.find_root().command.main, standalone_mode=False)
        for name in study or shipped_studies():
            say(name)
            results.append(replicate_study(run, name, data, slow))
    save_json(
        json, {"studies": [one.summary() | {"rows": [asdict(row) for row in one.rows]} for one in results]}
    )
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        rows = rows_table(results)
        rows.to_csv(out / "comparison.csv", index=False)
        tables = [studies_table(results), differences_table(results)]
        (out / "comparison.md").write_text("\n".join(map(as_markdown, tables)), encoding="utf-8")
        typer.echo(f"written to {out}: comparison.csv ({len(rows)} numbers), comparison.md")
    show_tables(studies_table(results))
    for study_name, number, printed, ours, why in differences_table(results).rows:
        show_text(f"- {study_name}, {number}: printed {printed}, ours {ours}: {why}.")
    if any(one.unexplained for one in results):
        raise typer.Exit(1)
