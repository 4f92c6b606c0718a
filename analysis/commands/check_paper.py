"""`analysis check-paper`: what printed figures and sentences say about themselves."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(name="check-paper")(check_paper)


def check_paper(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="A manuscript or report (HTML, TeX, DOCX, PDF, Markdown, text), or a TOML file of printed "
            "figures; the shipped figures of the paper if left out."
        ),
    ] = None,
    json: Annotated[Path | None, typer.Option(help="Write the findings to this JSON file too.")] = None,
) -> None:
    """Check a paper from what it prints: p, df and effect sizes of its statistics; SE or SD; joint means.

    Examples:

      analysis check-paper manuscript.docx

      analysis check-paper out/analysis/exp1/report.html --json findings.json

      analysis check-paper figures.toml

    Exit code 1 where a statistic or figure does not fit.
    The shipped analysis/paper/published/FIGURES.toml shows the format of figures (docs/analysis.md).
    """
    from analysis.paper.printed import SHIPPED

    if file is None or file.suffix.lower() == ".toml":
        wrong = _check_figures(file or SHIPPED, json)
    else:
        wrong = _check_document(file, json)
    if wrong:
        raise typer.Exit(1)


def _check_document(file: Path, json: Path | None) -> int:
    """Print what a manuscript's statistics say; how many do not fit."""
    from analysis.paper.document import read_document
    from analysis.paper.statistics import check_text
    from analysis.report.formats import wrap
    from experiments.files import whole_file
    from experiments.json import json_text

    result = check_text(read_document(file))
    if json is not None:
        counts = {"read": len(result.statistics), "checked": result.n_checked, "wrong": result.n_wrong}
        with whole_file(json) as temporary:
            temporary.write_text(json_text({"file": file.name, **counts, **asdict(result)}), encoding="utf-8")
    typer.echo(
        f"{file.name}: {len(result.statistics)} statistics read, {result.n_checked} checked, "
        f"{result.n_wrong} do not fit, {len(result.unread)} could not be read"
    )
    for statistic in result.statistics:
        for problem in statistic.problems:
            grave = " (significant by one, not by the other)" if statistic.verdict == "decision" else ""
            typer.echo("\n".join(wrap(f"- {statistic.text}: {problem}{grave}")))
    for fragment in result.unread:
        typer.echo("\n".join(wrap(f"- could not be read: {fragment}")))
    return result.n_wrong


def _check_figures(figures: Path, json: Path | None) -> int:
    """Print what printed figures say of each other; how many problems they have, notes not counted."""
    from analysis.paper import check as checks
    from analysis.paper.printed import load_figures
    from analysis.report.formats import wrap
    from experiments.files import whole_file
    from experiments.json import json_text

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
