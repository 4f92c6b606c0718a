"""The audit log's chain: whole, broken at each place, under many hands at once, and during erasures."""

import json
import queue
import socket
import ssl
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import NameOID
from pydantic import ValidationError
from sqlalchemy import text

from server.accounts import repository
from server.accounts.audit import Verdict, _send, record, verify
from server.accounts.cli import _lines
from server.context import Services, open_services
from server.core.db import open_database
from server.core.settings import Settings, syslog_address
from server.core.values import now
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant, StudyInDatabase


def verdict(services: Services, kept: tuple[int, str] | None = None) -> Verdict:
    with services.database.read() as session:
        return verify(session, services.settings.key, kept)


def write_three(services: Services) -> None:
    for number in range(3):
        with services.database.write() as session:
            record(session, None, "study created", "study", f"s{number}", note=f"n{number}", number=number)


def change(services: Services, statement: str, **values: Any) -> None:
    with services.database.write() as session:
        session.execute(text(statement), values)


def test_entries_are_chained_in_the_order_of_their_commits(services: Services) -> None:
    write_three(services)
    found = verdict(services)
    assert (found.position, found.erased, found.before, found.broken) == (3, 0, 0, None)
    with services.database.write() as session:
        for action in ("a", "b"):
            record(session, None, action)
    assert verdict(services).position == 5
    assert verdict(services, (found.position, found.hash)).broken is None


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ("UPDATE audit_entries SET actor = 'somebody' WHERE position = 2", "entry 2"),
        ("UPDATE audit_entries SET action = 'x' WHERE position = 2", "entry 2"),
        ("UPDATE audit_entries SET target = 'other' WHERE position = 2", "entry 2"),
        ("UPDATE audit_entries SET target_kind = 'run' WHERE position = 2", "entry 2"),
        ("UPDATE audit_entries SET at = '2020-01-01 00:00:00' WHERE position = 2", "entry 2"),
        ('UPDATE audit_entries SET details = \'{"note": "x"}\' WHERE position = 2', "details were changed"),
        (
            "UPDATE audit_entries SET details_salt = NULL WHERE position = 2",
            "no erasure of a person explains it",
        ),
        ("UPDATE audit_entries SET chain_hash = details_digest WHERE position = 2", "entry 2"),
        ("DELETE FROM audit_entries WHERE position = 2", "entry 2 is missing"),
        ("UPDATE audit_entries SET position = NULL WHERE position = 3", "it was inserted"),
        ("UPDATE audit_entries SET position = 9 WHERE position = 3", "entry 3 is missing"),
    ],
)
def test_the_first_entry_that_was_tampered_with_is_named(
    services: Services, statement: str, said: str
) -> None:
    write_three(services)
    change(services, statement)
    broken = verdict(services).broken
    assert broken is not None
    assert said in broken
    assert "\n" not in broken


def test_another_key_does_not_make_the_same_chain(services: Services) -> None:
    write_three(services)
    with services.database.read() as session:
        broken = verify(session, b"another key").broken
    assert broken is not None
    assert "entry 1 " in broken


def test_entries_that_were_cut_off_are_missed_where_the_head_was_kept(services: Services) -> None:
    write_three(services)
    head = verdict(services)
    change(services, "DELETE FROM audit_entries WHERE position = 3")
    assert verdict(services).broken is None
    broken = verdict(services, (head.position, head.hash)).broken
    assert broken is not None
    assert "changed or removed" in broken


def test_many_at_once_make_one_chain(services: Services) -> None:
    others = [open_database(services.settings) for _ in range(2)]  # as two more workers

    def write(number: int) -> None:
        with others[number % 2].write() as session:
            record(session, None, "busy", "study", str(number))
            record(session, None, "busy again", "study", str(number))

    with ThreadPoolExecutor(8) as threads:
        list(threads.map(write, range(40)))
    for database in others:
        database.close()
    found = verdict(services)
    assert (found.position, found.broken) == (80, None)


def test_what_was_written_before_there_was_a_chain_stays_outside_it(services: Services) -> None:
    change(
        services,
        "INSERT INTO audit_entries (at, actor, action, target_kind, target, details) "
        "VALUES ('2025-01-01 00:00:00', 'ada', 'study created', 'study', 'old', '{}')",
    )
    write_three(services)
    found = verdict(services)
    assert (found.position, found.before, found.broken) == (3, 1, None)


def test_an_erased_person_leaves_the_chain_whole(
    services: Services, owner: Admin, participant: Participant
) -> None:
    participant.agree()
    run = participant.run_id
    path = f"/studies/short/runs/{run}"
    assert owner.send("PUT", f"{path}/exclusion", {"reason": "Mrs Miller slept"}).status_code == 204
    assert owner.send("POST", f"{path}/erase", {"confirm": run}).status_code == 200
    found = verdict(services)
    assert (found.erased, found.broken) == (1, None)
    with services.database.read() as session:
        assert not [entry for entry in repository.chained_entries(session) if "Miller" in str(entry.details)]


def test_looks_at_persons_and_downloads_are_in_the_log(
    owner: Admin, study: StudyInDatabase, participant: Participant
) -> None:
    participant.agree()
    owner.get("/studies/short/runs")
    owner.get(f"/studies/short/runs/{participant.run_id}")
    owner.get(f"/studies/short/runs/{participant.run_id}/identity")
    owner.get("/studies/short/data/ratings.csv")
    owner.get("/studies/short/links/personal.csv")
    actions = [row["action"] for row in owner.get("/audit").json()][:5]
    assert actions == [
        "personal links downloaded",
        "data downloaded",
        "identity read",
        "personal data read",
        "participants listed",
    ]


def test_the_export_ends_with_the_chains_head(services: Services) -> None:
    write_three(services)
    lines = [json.loads(line) for line in _lines(services.database, 1)]
    head = verdict(services)
    assert [line["position"] for line in lines[:-1]] == [2, 3]
    assert lines[-1] == {"complete": True, "entries": 2, "head": f"{head.position}:{head.hash}"}


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_syslog_gets_each_entry_after_its_commit_without_details(services: Services, host: str) -> None:
    is_ipv6 = ":" in host
    if is_ipv6 and not has_ipv6():
        pytest.skip("this machine has no IPv6")
    with socket.socket(socket.AF_INET6 if is_ipv6 else socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind((host, 0))
        listener.settimeout(10)
        port = listener.getsockname()[1]
        address = f"[{host}]:{port}" if is_ipv6 else f"{host}:{port}"
        settings = services.settings.model_copy(update={"audit_syslog": address})
        told = open_services(settings)
        with told.database.write() as session:
            record(session, None, "study created", "study", "s", note="not for syslog")
        sent = listener.recv(4096).decode()
        told.database.close()
    assert '"action": "study created"' in sent
    assert verdict(services).hash in sent
    assert "not for syslog" not in sent


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("[2001:db8::5]:5514", ("2001:db8::5", 5514)),
        ("[::1]", ("::1", 514)),
        ("[fe80::1%eth0]:514", ("fe80::1%eth0", 514)),
    ],
)
def test_an_ipv6_address_of_syslog_is_in_brackets(written: str, read: tuple[str, int]) -> None:
    assert syslog_address(written) == ("udp", *read)
    for scheme in ("", "tcp://", "tls://"):
        assert Settings(audit_syslog=scheme + written).audit_syslog == scheme + written


@pytest.mark.parametrize(
    "wrong",
    ["::1", "::1:514", "[logs]:514", "[::1", "[]", "a:b", "tcp://", "udp://a:1", "a:65536", "a:0", "ftp://a"],
)
def test_what_is_not_an_address_of_syslog_is_refused_at_the_start(wrong: str) -> None:
    with pytest.raises(ValidationError, match="expected /dev/log, host:port"):
        Settings(audit_syslog=wrong)


def test_a_colon_without_a_port_is_the_usual_port() -> None:
    assert syslog_address("logs.example.org:") == ("udp", "logs.example.org", 514)


def test_a_name_that_is_none_for_dns_costs_its_entry_and_no_later_one(
    caplog: pytest.LogCaptureFixture,
) -> None:
    waiting: queue.Queue[str] = queue.Queue()
    for line in ("one", "two"):
        waiting.put(line)
    threading.Thread(target=_send, args=("a..b:514", waiting), daemon=True).start()
    ends = time.monotonic() + 30
    while caplog.text.count("could not be sent to syslog") < 2 and time.monotonic() < ends:
        time.sleep(0.01)
    assert caplog.text.count("could not be sent to syslog") == 2


class _Collector(threading.Thread):
    """A syslog that takes one connection after the other, the first message of each; with TLS or without."""

    def __init__(self, connections: int, certificate: Path | None) -> None:
        super().__init__(daemon=True)
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.listener.settimeout(20)
        self.connections, self.taken, self.context = connections, list[bytes](), None
        if certificate is not None:
            self.context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
            self.context.load_cert_chain(certificate)

    def run(self) -> None:
        with self.listener:
            for _ in range(self.connections):
                self._take()

    def _take(self) -> None:
        connection, _ = self.listener.accept()
        try:
            if self.context is not None:
                connection = self.context.wrap_socket(connection, server_side=True)
            with connection, connection.makefile("rb") as stream:
                length = b"".join(iter(lambda: stream.read(1), b" "))
                message = stream.read(int(length))
        except ssl.SSLError:
            message = b"refused"
        self.taken.append(message)  # once the connection is closed


def has_ipv6() -> bool:
    """Whether this machine's own IPv6 address can be bound; containers often have none."""
    try:
        with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as probe:
            probe.bind(("::1", 0))
    except OSError:
        return False
    return True


def self_signed(folder: Path) -> Path:
    """Certificate and key of localhost, in one file."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "localhost")])
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(now() - timedelta(days=1))
        .not_valid_after(now() + timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName([x509.DNSName("localhost")]), critical=False)
        .sign(key, hashes.SHA256())
    )
    form = (Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    path = folder / "localhost.pem"
    path.write_bytes(made.public_bytes(Encoding.PEM) + key.private_bytes(*form))
    return path


def sending_to_a_collector(
    services: Services, messages: int, scheme: str, certificate: Path
) -> tuple["_Collector", Services]:
    """A syslog that takes so many messages, and a server whose audit log goes to it."""
    collector = _Collector(messages, certificate if scheme == "tls" else None)
    collector.start()
    address = f"{scheme}://localhost:{collector.listener.getsockname()[1]}"
    return collector, open_services(services.settings.model_copy(update={"audit_syslog": address}))


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize("scheme", ["tcp", "tls"])
def test_syslog_over_a_stream_gets_whole_messages(
    services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scheme: str
) -> None:
    if scheme == "tls":
        monkeypatch.setenv("SSL_CERT_FILE", str(self_signed(tmp_path)))
    collector, told = sending_to_a_collector(services, 1, scheme, tmp_path / "localhost.pem")
    with told.database.write() as session:
        record(session, None, "study created", "study", "s", note="not for syslog")
    collector.join(20)
    told.database.close()
    [sent] = collector.taken
    assert sent.startswith(b"<38>palpebra-audit: {")  # auth, info
    assert b'"action": "study created"' in sent
    assert verdict(services).hash.encode() in sent
    assert b"not for syslog" not in sent


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize("scheme", ["tcp", "tls"])
def test_a_syslog_that_hung_up_gets_the_next_message_too(
    services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scheme: str
) -> None:
    if scheme == "tls":
        monkeypatch.setenv("SSL_CERT_FILE", str(self_signed(tmp_path)))
    collector, told = sending_to_a_collector(services, 3, scheme, tmp_path / "localhost.pem")
    for number in range(3):
        with told.database.write() as session:
            record(session, None, "study created", "study", f"s{number}")
        deadline = time.monotonic() + 20
        while len(collector.taken) <= number and time.monotonic() < deadline:
            time.sleep(0.01)
    told.database.close()
    assert [f'"target": "s{number}"'.encode() in sent for number, sent in enumerate(collector.taken)] == [
        True
    ] * 3


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_syslog_whose_certificate_nobody_vouches_for_gets_nothing(
    services: Services, tmp_path: Path
) -> None:
    collector, told = sending_to_a_collector(services, 1, "tls", self_signed(tmp_path))
    with told.database.write() as session:
        record(session, None, "study created", "study", "s")
    collector.join(20)
    told.database.close()
    assert collector.taken == [b"refused"]


@pytest.mark.parametrize("address", ["no-such-host.invalid:514", "/nowhere/socket", "tls://localhost:1"])
def test_a_syslog_that_is_away_costs_no_request(services: Services, address: str) -> None:
    told = open_services(services.settings.model_copy(update={"audit_syslog": address}))
    for number in range(2):
        with told.database.write() as session:
            record(session, None, "study created", "study", f"s{number}")
    told.database.close()
    assert verdict(services).position == 2
