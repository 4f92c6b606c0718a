"""The generated pages explain every column; that they are current is said by `make check`."""

from tests.conftest import REPOSITORY


def test_every_exported_column_is_explained() -> None:
    from experiments.columns import RUN_COLUMNS
    from experiments.kinds import views

    page = (REPOSITORY / "docs" / "reference" / "columns.md").read_text(encoding="utf-8")
    for column in (*RUN_COLUMNS, *(column for view in views() for column in view.columns)):
        assert f"| `{column.name}` | {column.type} |" in page
        assert column.description.endswith(".")


def test_no_page_shows_how_python_writes_a_type() -> None:
    page = (REPOSITORY / "docs" / "reference" / "settings.md").read_text(encoding="utf-8")
    assert "<class" not in page
    assert "| `PALPEBRA_BACKUP_IDENTITY` | Path or empty | empty |" in page
