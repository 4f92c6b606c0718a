"""Fill the templates of a report."""

from functools import cache
from typing import TYPE_CHECKING, Any

from analysis.report.formats import as_markdown
from analysis.report.italics import heading_pieces, pieces, signed, signed_cell

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup


def filled(template: str, **values: Any) -> str:
    """A template of this folder with its values; HTML is escaped, every value must be given."""
    return _environment().get_template(template).render(**values)


@cache
def _environment() -> "Environment":
    # as with matplotlib: commands that only print tables need not pay for the import
    from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

    environment = Environment(
        loader=PackageLoader("analysis", "report/templates"),
        autoescape=select_autoescape(("html.j2",), default=False),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["markdown_table"] = as_markdown
    environment.filters["italics"] = lambda text: _in_italics(pieces(signed(text)))
    environment.filters["headings"] = lambda header: [_in_italics(head) for head in heading_pieces(header)]
    environment.filters["signed_cell"] = signed_cell
    return environment


def _in_italics(split: list[tuple[str, bool]]) -> "Markup":
    """Pieces as HTML, symbols of statistics in italics."""
    from markupsafe import Markup, escape

    return Markup().join(
        Markup("<i>{}</i>").format(piece) if is_symbol else escape(piece) for piece, is_symbol in split
    )
