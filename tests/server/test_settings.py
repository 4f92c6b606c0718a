import stat
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from server.cli import main
from server.core.settings import Settings


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


def test_an_empty_variable_is_one_that_was_not_set(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DATA_FOLDER", "SHARED_FOLDER", "SMTP_PASSWORD_FILE", "SESSION_IDLE"):
        monkeypatch.setenv(f"PALPEBRA_{name}", "")
    set_empty = Settings()
    monkeypatch.undo()
    assert set_empty == Settings()


def test_every_setting_is_described() -> None:
    described = (Path(__file__).resolve().parents[2] / "docs" / "reference" / "settings.md").read_text(
        encoding="utf-8"
    )
    for name, field in Settings.model_fields.items():
        assert field.description, name
        variable = "DATABASE_URL" if name == "database_url" else f"PALPEBRA_{name.upper()}"
        assert f"`{variable}`" in described or f"`{variable}__NAME__KEY`" in described, variable


def test_a_provider_of_sign_in_is_declared_key_by_key(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    secret = tmp_path / "secret"
    secret.write_text("of the client\n")
    declared = {
        "LABEL": "Example University",
        "ISSUER": "https://login.uni.example",
        "CLIENT_ID": "palpebra",
        "CLIENT_SECRET_FILE": str(secret),
        "ROLES": '[{"claim": "groups", "value": "lab", "workspace": "lab", "role": "viewer"}]',
    }
    for key, value in declared.items():
        monkeypatch.setenv(f"PALPEBRA_OIDC__UNI__{key}", value)
    uni = Settings().oidc["uni"]
    assert (uni.client_secret(), uni.roles[0].workspace) == ("of the client", "lab")
    assert uni.second_factor_amr == uni.second_factor_acr == ()


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("ISSUER", "http://login.uni.example", "expected https"),
        ("CLIENT_SECRET_FILE", "/nowhere/secret", "expected a readable file"),
        ("SCOPES", "profile", "expected 'openid'"),
        (
            "ROLES",
            '[{"claim": "groups", "workspace": "lab", "role": "viewer"}]',
            "expected both claim and value",
        ),
        ("ROLES", '[{"workspace": "lab", "role": "emperor"}]', "'viewer', 'experimenter' or 'owner'"),
        ("SECRET", "in the environment", "Extra inputs"),
    ],
)
def test_a_provider_that_is_declared_wrongly_is_reported_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], key: str, value: str, said: str
) -> None:
    known = {"LABEL": "Uni", "ISSUER": "https://login.uni.example", "CLIENT_ID": "palpebra", key: value}
    for name, told in known.items():
        monkeypatch.setenv(f"PALPEBRA_OIDC__UNI__{name}", told)
    monkeypatch.setattr("sys.argv", ["server", "audit", "verify"])
    with pytest.raises(SystemExit):
        main()
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: PALPEBRA_OIDC__UNI__{key}")
    assert said in line


@pytest.mark.parametrize("noted", [None, "http://localhost:8123\n"])
def test_address_is_that_of_the_last_start_unless_it_is_set(
    noted: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if noted is not None:
        (tmp_path / "address").write_text(noted, encoding="utf-8")
    expected = (noted or "http://localhost:8000").strip()
    for unset in (None, ""):
        if unset is None:
            monkeypatch.delenv("PALPEBRA_PUBLIC_URL", raising=False)
        else:
            monkeypatch.setenv("PALPEBRA_PUBLIC_URL", unset)
        assert Settings(data_folder=tmp_path).public_url == expected
    monkeypatch.setenv("PALPEBRA_PUBLIC_URL", "https://lab.example.org")
    assert Settings(data_folder=tmp_path).public_url == "https://lab.example.org"
