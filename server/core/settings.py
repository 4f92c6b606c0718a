"""Every setting of the server, read from environment variables; and its data folder and key file."""

import os
import re
import secrets
from datetime import timedelta
from email.utils import parseaddr
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self
from urllib.parse import urlsplit

from pydantic import (
    AliasChoices,
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    field_validator,
    model_validator,
)
from pydantic_settings import BaseSettings, SettingsConfigDict

from experiments.errors import InputError
from experiments.files import with_driver
from server.core.values import Role

# The file that keeps the secret key in the data folder: for its owner alone, made once for all workers.


def built_pages() -> Path:
    """The folder of the built pages: inside the installed package, or in a checkout."""
    packaged = REPOSITORY / "palpebra" / "pages"
    return packaged if packaged.is_dir() else REPOSITORY / "frontend" / "dist"


def secret_key_path(data_folder: Path) -> Path:
    """Where the key of this data folder is kept."""
    return data_folder / "secret_key"


def kept_key(path: Path) -> bytes:
    """The key of a file; generated with file mode 600 where it is not there yet."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    if not path.is_file():
        put_key(temporary, secrets.token_hex(32).encode("ascii"))
        try:
            # A link fails where another worker was first, so that all of them read one key.
            os.link(temporary, path)
        except FileExistsError:
            pass
        finally:
            temporary.unlink()
    return path.read_bytes().strip()


def put_key(path: Path, key: bytes) -> None:
    """Write a key into a file that is not there yet, with file mode 600."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as stream:
        stream.write(key)


# Where a syslog listens, as `PALPEBRA_AUDIT_SYSLOG` says it.

USUAL_PORTS = {"udp": 514, "tcp": 601, "tls": 6514}
MAX_PORT = 65_535
_TEXT = re.compile(
    r"((?P<transport>tcp|tls)://)?"
    r"(\[(?P<address>[0-9A-Fa-f:.]+(%\w+)?)\]|(?P<name>[^/:\[\]]+))"
    r"(:(?P<port>\d{0,5}))?"
)
Transport = Literal["socket", "udp", "tcp", "tls"]


class SyslogAddress(NamedTuple):
    """A socket of this machine, by its path as `host`, or a host and a port."""

    transport: Transport
    host: str
    port: int


def syslog_address(text: str) -> SyslogAddress:
    """A socket's path, or host and port.

    Raises
    ------
    InputError
        It is neither.

    Examples
    --------
    >>> syslog_address("logs.example.org:5514")
    SyslogAddress(transport='udp', host='logs.example.org', port=5514)
    >>> syslog_address("tls://[2001:db8::5]")
    SyslogAddress(transport='tls', host='2001:db8::5', port=6514)
    >>> syslog_address("/dev/log")
    SyslogAddress(transport='socket', host='/dev/log', port=0)
    """
    if text.startswith("/"):
        return SyslogAddress("socket", text, 0)
    parts = _TEXT.fullmatch(text)
    transport: Transport = "udp"
    if parts is not None and parts["transport"]:
        transport = "tls" if parts["transport"] == "tls" else "tcp"
    port = int((parts and parts["port"]) or USUAL_PORTS[transport])
    if parts is None or not 0 < port <= MAX_PORT:
        raise InputError(
            "expected /dev/log, host:port (UDP), tcp://host:port or tls://host:port, an IPv6 address as "
            f"[2001:db8::5]:port, got '{text[:100]}'"
        )
    return SyslogAddress(transport, parts["address"] or parts["name"], port)


# What is declared of a provider of sign-in (OpenID Connect) in the environment.

ProviderId = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,29}$")]
LOCAL_HOSTS = ("localhost", "127.0.0.1", "::1")


class _DeclaredTable(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class RoleRule(_DeclaredTable):
    """Who belongs to a workspace by what the provider says of her.

    Without a claim it holds for everybody whom the provider signs in.
    """

    workspace: Annotated[str, StringConstraints(min_length=1, max_length=60)] = Field(
        description="Name of the workspace."
    )
    role: Role = Field(description="Role in the workspace: viewer, experimenter or owner.")
    claim: str = Field(default="", description="Name of the claim; use dots for nested claims.")
    value: str = Field(default="", description="Required value of the claim, or an element if it is a list.")

    @model_validator(mode="after")
    def _claim_with_value(self) -> Self:
        if bool(self.value) != bool(self.claim):
            raise ValueError("expected both claim and value, or neither")
        return self


class Provider(_DeclaredTable):
    """A service that signs people in; declared as PALPEBRA_OIDC__NAME__KEY."""

    label: Annotated[str, StringConstraints(min_length=1, max_length=60)] = Field(
        description="Label of the button after 'Sign in with'."
    )
    issuer: str = Field(description="URL of the provider, exactly as in its tokens.")
    client_id: Annotated[str, StringConstraints(min_length=1)] = Field(
        description="Name of this server at the provider."
    )
    client_secret_file: Path | None = Field(
        default=None, description="File with the secret; empty for a public client."
    )
    scopes: str = Field(
        default="openid profile", description="Requested scopes, which must include `openid`."
    )
    roles: tuple[RoleRule, ...] = Field(
        default=(),
        description=(
            "Rules for workspace membership; without a matching rule, only linked accounts can sign in."
        ),
    )
    second_factor_amr: tuple[str, ...] = Field(
        default=(), description="Values of `amr` that count as a second factor here; empty for none."
    )
    second_factor_acr: tuple[str, ...] = Field(
        default=(), description="Values of `acr` that count as a second factor here; empty for none."
    )

    @field_validator("issuer")
    @classmethod
    def _is_safe(cls, value: str) -> str:
        if not is_safe(value) or urlsplit(value).query or urlsplit(value).fragment:
            raise ValueError("expected https://... without a query (http only on this machine)")
        return value

    @field_validator("scopes")
    @classmethod
    def _asks_for_openid(cls, value: str) -> str:
        if "openid" not in value.split():
            raise ValueError("expected 'openid' among the scopes")
        return value

    @field_validator("client_secret_file")
    @classmethod
    def _is_readable(cls, value: Path | None) -> Path | None:
        if value is not None and not (value.is_file() and os.access(value, os.R_OK)):
            raise ValueError(f"expected a readable file, got {value}")
        return value

    def client_secret(self) -> str | None:
        """The secret as the file holds it now, so that it can be exchanged while the server runs."""
        if self.client_secret_file is None:
            return None
        return self.client_secret_file.read_text(encoding="utf-8").strip()


def is_safe(address: str) -> bool:
    """True for https, and for http that does not leave this machine."""
    parts = urlsplit(address)
    return bool(parts.hostname) and (
        parts.scheme == "https" or (parts.scheme == "http" and parts.hostname in LOCAL_HOSTS)
    )


# Every setting of the server in one documented class, read from environment variables.

KEY_LENGTH_MIN = 32
"""Characters of a secret key that somebody sets; the ones that are made here have 64."""
ADDRESS_FILE = "address"
"""File of the data folder with the URL of the server that was started last."""
REPOSITORY = Path(__file__).resolve().parents[2]


class Settings(BaseSettings):
    """Settings of the server: `PALPEBRA_<NAME>` in the environment, and `DATABASE_URL`.

    Times are in minutes, hours or seconds, as the name indicates; sizes are in bytes.
    """

    # An empty variable is one that compose or a shell passes on without a value.
    model_config = SettingsConfigDict(
        env_prefix="PALPEBRA_",
        env_nested_delimiter="__",
        env_ignore_empty=True,
        validate_by_name=True,
        extra="ignore",
    )

    data_folder: Path = Field(
        default=Path("data"),
        description="Folder for all data of the server: database, clips, secret key.",
    )
    shared_folder: Path | None = Field(
        default=None,
        description=(
            "Folder mounted by all hosts of a server, for shared files: uploads, reports, "
            "capsules, rehearsals, the ledger of erasures. Empty: the data folder."
        ),
    )
    database_url: str = Field(
        default="",
        validation_alias=AliasChoices("DATABASE_URL", "PALPEBRA_DATABASE_URL"),
        description=(
            "Database URL: empty for SQLite in the data folder, or postgresql://user:password@host/name."
        ),
    )
    database_pool: int = Field(
        default=20, ge=1, description="Maximum number of database connections per worker."
    )
    public_url: str = Field(
        default="http://localhost:8000",
        description=(
            "URL under which participants reach the server. If it is not set, `server run` uses "
            "http://localhost and its port, and commands use that of the last start."
        ),
    )
    secret_key: str = Field(
        default="",
        description=(
            "Key from which tokens are derived, at least 32 random characters. Empty: "
            "data_folder/secret_key, generated at the first start."
        ),
    )
    frontend_folder: Path = Field(
        default=built_pages(),
        description="Folder of the built pages (participant, admin).",
    )
    library_folder: Path = Field(
        default=REPOSITORY / "stimuli_builder" / "blinks" / "library",
        description="Folder of the included blink profiles and model, for the figures page.",
    )
    max_body_bytes: int = Field(
        default=512 * 1024, ge=1024, description="Maximum size of a request from a participant."
    )
    max_upload_bytes: int = Field(
        default=2 * 1024**3,
        ge=1024,
        description=("Maximum size of a request from an experimenter, including clip uploads."),
    )
    max_uploads_bytes: int = Field(
        default=64 * 1024**3,
        ge=1024,
        description="Maximum total size of one account's uploads. Each upload is removed after a day.",
    )
    run_starts_per_minute: int = Field(
        default=3000, ge=1, description="Maximum number of runs started per link and minute."
    )
    audit_syslog: str = Field(
        default="",
        description=(
            "Syslog that also receives the audit log, without details: /dev/log, host:port (UDP), "
            "tls://host:port (certificate checked) or tcp://host:port. IPv6 addresses in []."
        ),
    )
    evidence: Literal["refuse", "record"] = Field(
        default="refuse",
        description="What to do with implausible answers: refuse them, or record and judge them.",
    )
    unsupported_per_minute: int = Field(
        default=300,
        ge=1,
        description=("Maximum number of reports of unsupported browsers per link and minute."),
    )
    preview_keep_hours: float = Field(
        default=24.0, gt=0, description="Hours until the answers of a preview are deleted."
    )
    session_hours: float = Field(default=12.0, gt=0, description="Hours an experimenter stays signed in.")
    ignore_clock: bool = Field(
        default=False,
        description="Start although the clock of this machine is behind entries of the database.",
    )
    session_idle_minutes: float = Field(
        default=120.0,
        gt=0,
        description="Minutes of inactivity until an experimenter is signed out.",
    )
    owners_second_factor: bool = Field(
        default=False,
        description=(
            "Owners of the server have only the rights of experimenters until they sign in with a "
            "second factor."
        ),
    )
    logins_per_minute: int = Field(
        default=30,
        ge=1,
        description=(
            "Sign-in attempts per minute from one range of addresses (/24, /64), or from one known browser."
        ),
    )
    logins_per_minute_overall: int = Field(
        default=120, ge=1, description="Sign-in attempts per minute from browsers not seen before."
    )
    oidc: dict[ProviderId, Provider] = Field(
        default={},
        description="Services that sign people in (OpenID Connect): LABEL, ISSUER, CLIENT_ID, "
        "CLIENT_SECRET_FILE and more for each; see docs/how-to/sign-in.md.",
    )
    smtp_host: str = Field(
        default="", description="SMTP server for email, such as new passwords. Empty: no email is sent."
    )
    smtp_port: int = Field(
        default=587, ge=1, le=65535, description="Port of the SMTP server; use 465 for tls."
    )
    smtp_security: Literal["starttls", "tls", "none"] = Field(
        default="starttls",
        description=(
            "Encryption of the connection to the SMTP server; none is allowed only on this machine."
        ),
    )
    smtp_user: str = Field(default="", description="User name for the SMTP server; empty if none is needed.")
    smtp_password_file: Path | None = Field(
        default=None, description="File with the password for the SMTP server."
    )
    mail_from: str = Field(
        default="", description="Sender of emails, such as 'Palpebra <palpebra@lab.example>'."
    )
    webhook_url: str = Field(
        default="",
        description="HTTPS address that gets warnings about studies as JSON, such as that of a chat channel.",
        repr=False,
    )
    monitor_stream_minutes: float = Field(
        default=60.0, gt=0, description="Minutes after which the browser of the live monitor reconnects."
    )
    s3_bucket: str = Field(
        default="", description="Bucket of an S3-compatible store for clips; empty: the data folder."
    )
    s3_prefix: str = Field(default="", description="Folder of the clips within the bucket.")
    s3_endpoint: str = Field(
        default="",
        description="URL of the object store if it is not Amazon's, such as https://s3.lab.example.",
    )
    s3_region: str = Field(default="us-east-1", description="Region of the bucket.")
    s3_presigned: bool = Field(
        default=False,
        description="Browsers download clips from the store with signed URLs; otherwise through the server.",
    )
    capsules_kept: int = Field(
        default=5,
        ge=1,
        description="Number of finished capsules kept per study; a new one replaces the oldest.",
    )
    capsule_keep_days: float = Field(
        default=90.0,
        gt=0,
        description=(
            "Days after which a capsule or a failed attempt is removed, when the next one is finished."
        ),
    )
    log_format: Literal["auto", "json", "text"] = Field(
        default="auto", description="Format of the log on stderr: json, text, or auto (text on a terminal)."
    )
    log_requests: Literal["problems", "all", "none"] = Field(
        default="problems",
        description=(
            "Which requests are logged; problems: those that failed or were slow. IP addresses are "
            "never logged."
        ),
    )
    log_slow_ms: float = Field(
        default=1000.0, gt=0, description="Milliseconds above which a request counts as slow."
    )
    free_megabytes_min: float = Field(
        default=200.0,
        ge=0,
        description=("Minimum free space on the disk of the data folder; with less, /readyz returns 503."),
    )
    backup_folder: str = Field(
        default="",
        description=(
            "Folder of the backups, or s3://BUCKET/PREFIX. The server reports the age of the "
            "newest backup and test-restores it weekly."
        ),
    )
    snapshot_minutes: float = Field(
        default=0.0,
        ge=0,
        description="Minutes between snapshots of a SQLite database in data_folder/snapshots; 0: none.",
    )
    backup_keys: Path | None = Field(
        default=None,
        description="Key file of backups that are not encrypted, for `server backup`, `restore` and `drill`; "
        "by default, palpebra-keys.json next to the backup.",
    )
    backup_recipient: str = Field(
        default="",
        description="Public key (age1...) for which `server backup --to` encrypts; see `server backup-key`.",
    )
    backup_identity: Path | None = Field(
        default=None,
        description=(
            "File of the private key of encrypted backups; only needed for restore tests on this server."
        ),
    )
    security_contact: str = Field(
        default="",
        description="Contact for security reports, mailto: or https:; shown in /.well-known/security.txt.",
    )
    metrics_token: str = Field(
        default="",
        description="Token required by /metrics. Empty: only requests from this machine are answered.",
    )

    @field_validator("database_url")
    @classmethod
    def _with_driver(cls, value: str) -> str:
        return with_driver(value)

    @field_validator("audit_syslog")
    @classmethod
    def _is_where_a_syslog_listens(cls, value: str) -> str:
        if value:
            syslog_address(value)
        return value

    @field_validator("security_contact")
    @classmethod
    def _is_an_address(cls, value: str) -> str:
        if value and not (value.startswith(("mailto:", "https://")) and value.isprintable()):
            raise ValueError("expected mailto:name@example.org or https://..., in one line")
        return value

    @field_validator("mail_from")
    @classmethod
    def _is_one_address(cls, value: str) -> str:
        if value and ("@" not in parseaddr(value)[1] or not value.isprintable()):
            raise ValueError("expected one email address, such as 'Palpebra <palpebra@lab.example>'")
        return value

    @field_validator("webhook_url")
    @classmethod
    def _is_private_address(cls, value: str) -> str:
        parts = urlsplit(value)
        local = parts.scheme == "http" and parts.hostname in LOCAL_HOSTS
        if value and not (parts.hostname and (parts.scheme == "https" or local)):
            raise ValueError("expected https://..., or http:// on only this machine")
        return value

    @model_validator(mode="after")
    def _mail_is_private(self) -> Self:
        if self.smtp_host and self.smtp_security == "none" and self.smtp_host not in LOCAL_HOSTS:
            raise ValueError(
                "PALPEBRA_SMTP_SECURITY is none, which sends links unencrypted; it is allowed "
                "only for an SMTP server on this machine"
            )
        if self.smtp_host and not self.mail_from:
            raise ValueError("PALPEBRA_MAIL_FROM is required if PALPEBRA_SMTP_HOST is set")
        return self

    @model_validator(mode="before")
    @classmethod
    def _address_of_the_server(cls, values: dict[str, Any]) -> dict[str, Any]:
        """Commands print links for the port and the domain with which the server was last started."""
        if values.get("public_url"):
            return values
        values = {key: value for key, value in values.items() if key != "public_url"}
        folder = Path(values.get("data_folder") or cls.model_fields["data_folder"].default)
        try:
            noted = (folder / ADDRESS_FILE).read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError):
            return values
        return {**values, "public_url": noted} if noted.startswith(("http://", "https://")) else values

    @field_validator("public_url")
    @classmethod
    def _without_slash(cls, value: str) -> str:
        return value.rstrip("/")

    @property
    def is_https(self) -> bool:
        """True if participants reach the server through https."""
        return self.public_url.startswith("https://")

    @property
    def session_idle(self) -> timedelta:
        """How long a session may be unused."""
        return timedelta(minutes=self.session_idle_minutes)

    @property
    def clip_folder(self) -> Path:
        """Folder of the clips, each named by the hash of its bytes."""
        return self.data_folder / "clips"

    @property
    def stimuli_folder(self) -> Path:
        """Folder of the clip sets that `make run` builds, one per shipped experiment."""
        return self.data_folder / "stimuli"

    @property
    def strips_folder(self) -> Path:
        """Folder of the characters' picture strips, as `stimuli strips` writes them."""
        return self.stimuli_folder / "strips"

    @property
    def common_folder(self) -> Path:
        """Folder that all hosts of this server have in common."""
        return self.shared_folder or self.data_folder

    @property
    def upload_folder(self) -> Path:
        """Folder of uploads that wait to become studies."""
        return self.common_folder / "uploads"

    @property
    def resolved_database_url(self) -> str:
        """The database address, SQLite in the data folder where none is set."""
        if self.database_url:
            return self.database_url
        return f"sqlite:///{(self.data_folder / 'palpebra.sqlite').resolve()}"

    @property
    def is_local(self) -> bool:
        """True where only this machine reaches the server, so that no link leads here from elsewhere."""
        return urlsplit(self.public_url).hostname in LOCAL_HOSTS

    @property
    def has_short_key(self) -> bool:
        """Whether somebody set a secret key that can be guessed."""
        return 0 < len(self.secret_key) < KEY_LENGTH_MIN

    @cached_property
    def key(self) -> bytes:
        """The secret key; generated at first use with file mode 600 where none is set."""
        if self.secret_key:
            return self.secret_key.encode("utf-8")
        return kept_key(secret_key_path(self.data_folder))
