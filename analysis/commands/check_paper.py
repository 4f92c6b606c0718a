"""`analysis check-paper`: what printed figures say about themselves."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(name="check-paper")(check_paper)


def check_paper(
    figures: Annotated[
        Path | None,
        typer.Argument(help="TOML file of printed figures; the shipped ones of the paper if left out."),
    ] = None,
    json: Annotated[Path | None, typer.Option(help="Write the findings to this JSON file too.")] = None,
) -> None:
    """Check a paper from its printed figures alone: df, p, SE or SD, and means that cannot all hold.

    Examples:

      analysis check-paper

      analysis check-paper figures.toml --json findings.json

    The shipped analysis/paper/published/FIGURES.toml shows the format; docs/analysis.md explains it.
    """
    from analysis.files import json_text, whole_file
    from analysis.paper import check as checks
    from analysis.paper.printed import SHIPPED, load_figures
    from analysis.report.formats import wrap

    paper = load_figures(figures or SHIPPED)
    findings = checks.check_paper(paper)
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
    if json is not None:
        with whole_file(json) as temporary:
            temporary.write_text(json_text([asdict(finding) for finding in findings]), encoding="utf-8")
