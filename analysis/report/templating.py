"""Fill the templates of a report."""

from typing import Any

from analysis.report.formats import as_markdown


def filled(template: str, **values: Any) -> str:
    """A template of this folder with its values; HTML is escaped, every value must be given."""
    # as with matplotlib: commands that only print tables need not pay for the import
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("analysis", "report/templates"),
        autoescape=template.endswith(".html.j2"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["markdown_table"] = as_markdown
    return environment.get_template(template).render(**values)
