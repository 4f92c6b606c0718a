"""Write what is declared in code as documentation: docs/reference/columns.md, docs/reference/settings.md,
docs/reference/experiment.md.

python tools/reference.py           write them
python tools/reference.py --check   fail where they are not current
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from inspect import getdoc
from pathlib import Path
from typing import Any, get_args, get_origin

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from numpydoc.docscrape import NumpyDocString  # noqa: E402
from pydantic_core import PydanticUndefined  # noqa: E402
from sqlalchemy import Table  # noqa: E402

from experiments.columns import RUN_COLUMNS, Column  # noqa: E402
from experiments.kinds import views  # noqa: E402
from server.core.settings import Settings  # noqa: E402
from server.models import Base  # noqa: E402
from tools.experiment_reference import experiment_reference  # noqa: E402

MADE = "<!-- Written by `make docs` from the code; change it there. -->"


def table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    """A Markdown table."""
    yield "| " + " | ".join(header) + " |"
    yield "|" + "---|" * len(header)
    for row in rows:
        yield "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) + " |"


def column_row(column: Column) -> tuple[str, ...]:
    """One column of the export."""
    values = ", ".join(f"`{value}`" for value in column.values)
    return f"`{column.name}`", column.type, column.unit or "", values or column.allowed, column.description


def stored(of: Table) -> Iterator[str]:
    """A table of the database: what it is for, and its columns."""
    model = next(mapper.class_ for mapper in Base.registry.mappers if mapper.local_table is of)
    yield f"### {of.name}"
    yield ""
    told = NumpyDocString(getdoc(model) or "")
    yield " ".join([*told["Summary"], *told["Extended Summary"]]).strip()
    yield ""
    if told["Attributes"]:
        yield from (
            f"- `{entry.name.replace(', ', '`, `')}`: {' '.join(entry.desc)}" for entry in told["Attributes"]
        )
        yield ""
    columns = [f"`{column.name}`" + ("" if column.nullable else "*") for column in of.columns]
    yield "Columns (* never empty): " + ", ".join(columns) + "."
    yield ""


def data_dictionary() -> str:
    """The export's columns, and the tables behind them."""
    lines = [MADE, "# Data dictionary", ""]
    lines += [
        "Declared in `experiments/columns` and the kinds of trial. A CSV has one column per factor",
        "instead of `levels`; there, missing values are empty and booleans are 0 and 1. Times are UTC.",
        "Previews and erased people are excluded.",
        "",
    ]
    header = ("column", "type", "unit", "values or range", "meaning")
    for view in views():
        lines += [f"## {view.title} (the view `{view.name}`, and its CSV)", ""]
        lines += [*table(header, map(column_row, view.columns)), ""]
    lines += ["## Runs: one row per visit (the runs CSV)", "", *table(header, map(column_row, RUN_COLUMNS))]
    lines += ["", "## Tables of the database", ""]
    lines += [
        "The tables may change from version to version (by migrations); the views above are the contract.",
        "The server creates them again at a start whose code has other columns; manual changes are lost.",
        "",
    ]
    for each in Base.metadata.sorted_tables:
        lines += stored(each)
    return "\n".join(lines).rstrip() + "\n"


def setting_row(name: str, field: Any) -> tuple[str, ...]:
    """One setting."""
    variable = "DATABASE_URL" if name == "database_url" else f"PALPEBRA_{name.upper()}"
    default = "" if field.default in (PydanticUndefined, None) else field.default
    if isinstance(default, Path):
        default = default.relative_to(ROOT) if default.is_absolute() else default
    if get_origin(field.annotation) is dict:
        return f"`{variable}__NAME__KEY`", "table", "none", field.description
    kind = " or ".join(map(_told, get_args(field.annotation))) or field.annotation.__name__
    return f"`{variable}`", kind, f"`{default}`" if default != "" else "empty", field.description


def _told(kind: Any) -> str:
    """A type, or one of the words allowed, as a person reads it."""
    if kind is type(None):
        return "empty"
    return kind.__name__ if isinstance(kind, type) else str(kind)


def settings_reference() -> str:
    """Every environment variable of the server."""
    lines = [MADE, "# Settings of the server", "", "All settings come from the environment.", ""]
    rows = (setting_row(name, field) for name, field in Settings.model_fields.items())
    lines += table(("variable", "type", "default", "meaning"), rows)
    return "\n".join(lines) + "\n"


def declaration_reference() -> str:
    """Every key of the TOML."""
    return "\n".join(experiment_reference(MADE)).rstrip() + "\n"


PAGES = {
    "docs/reference/columns.md": data_dictionary,
    "docs/reference/settings.md": settings_reference,
    "docs/reference/experiment.md": declaration_reference,
}


def main() -> int:
    stale = []
    for name, text in PAGES.items():
        path = ROOT / name
        if path.is_file() and path.read_text(encoding="utf-8") == text():
            continue
        if "--check" in sys.argv:
            stale.append(name)
        else:
            path.write_text(text(), encoding="utf-8")
            print(f"wrote {name}")
    if stale:
        print(f"not current: {', '.join(stale)}; run `make docs`")
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
