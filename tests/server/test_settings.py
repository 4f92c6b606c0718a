import stat
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from server.settings import Settings


def test_the_secret_key_is_made_once_with_mode_600(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    with ThreadPoolExecutor(8) as pool:
        keys = set(pool.map(lambda _: Settings(data_folder=folder).key, range(8)))
    assert len(keys) == 1
    assert stat.S_IMODE((folder / "secret_key").stat().st_mode) == 0o600
    assert [path.name for path in folder.iterdir()] == ["secret_key"]


def test_settings_come_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PALPEBRA_PUBLIC_URL", "https://lab.example/")
    monkeypatch.setenv("DATABASE_URL", "postgres://me@host/name")
    settings = Settings()
    assert settings.public_url == "https://lab.example"
    assert settings.is_https
    assert settings.resolved_database_url == "postgresql+psycopg://me@host/name"


def test_without_a_database_url_sqlite_lies_in_the_data_folder(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("DATABASE_URL", raising=False)
    assert Settings(data_folder=tmp_path).resolved_database_url == f"sqlite:///{tmp_path}/palpebra.sqlite"


def test_every_setting_is_described() -> None:
    described = (Path(__file__).resolve().parents[2] / "docs" / "settings.md").read_text(encoding="utf-8")
    for name, field in Settings.model_fields.items():
        assert field.description, name
        variable = "DATABASE_URL" if name == "database_url" else f"PALPEBRA_{name.upper()}"
        assert f"`{variable}`" in described, variable
