"""docker-compose.yml against the compose specification's own schema, and our promises.

The schema is the one that check-jsonschema carries (compose-spec, Apache-2.0). The models below are narrower:
they say what this project's file may hold. `docker compose config` checks the whole where there is one.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

import pytest
import yaml
from pydantic import BaseModel, ConfigDict, Field

from tests.conftest import REPOSITORY

PATH = REPOSITORY / "docker-compose.yml"
DURATION = r"^(\d+(us|ms|s|m|h))+$"
EXACT = r":\d+\.\d+(\.\d+)?(-[a-z]+)?$"
"""PostgreSQL's own versions have two numbers."""
SIZE = r"^\d+(\.\d+)?(b|k|m|g|kb|mb|gb)$"


class Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class Healthcheck(Strict):
    test: list[str] | str | None = None
    interval: str | None = Field(default=None, pattern=DURATION)
    timeout: str | None = Field(default=None, pattern=DURATION)
    retries: int | None = None
    disable: bool | None = None


class Logging(Strict):
    driver: str
    options: dict[str, str | int]


class Dependency(Strict):
    condition: Literal["service_started", "service_healthy", "service_completed_successfully"]


class Service(Strict):
    image: str
    profiles: list[str] = []
    build: str | None = None
    user: str | None = None
    restart: Literal["no", "always", "on-failure", "unless-stopped"]
    read_only: bool
    cap_drop: list[str]
    cap_add: list[str] = []
    security_opt: list[str]
    logging: Logging
    tmpfs: list[str]
    networks: list[str]
    depends_on: dict[str, Dependency] = {}
    environment: dict[str, str | int] = {}
    command: list[str] | None = None
    entrypoint: list[str] | None = None
    volumes: list[str] = []
    ports: list[str] = []
    mem_limit: str = Field(pattern=SIZE)
    pids_limit: int = Field(gt=0)
    shm_size: str | None = Field(default=None, pattern=SIZE)
    stop_grace_period: str | None = Field(default=None, pattern=DURATION)
    healthcheck: Healthcheck | None = None


class Network(Strict):
    internal: bool = False


class Compose(Strict):
    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")
    services: dict[str, Service]
    networks: dict[str, Network]
    volumes: dict[str, dict[str, Any]]


@pytest.fixture(scope="module")
def compose() -> Compose:
    content = yaml.safe_load(PATH.read_text(encoding="utf-8"))
    return Compose.model_validate({key: value for key, value in content.items() if not key.startswith("x-")})


def specification_accepts(path: Path) -> tuple[bool, str]:
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    return done.returncode == 0, done.stdout + done.stderr


def test_the_specification_accepts_the_file_and_would_not_accept_another(tmp_path: Path) -> None:
    accepted, said = specification_accepts(PATH)
    assert accepted, said
    for sound, spoiled in (("cap_drop:", "cap_dropp:"), ("retries: 12", "retries: [12]")):
        wrong = tmp_path / "docker-compose.yml"
        wrong.write_text(PATH.read_text(encoding="utf-8").replace(sound, spoiled), encoding="utf-8")
        assert not specification_accepts(wrong)[0], spoiled


def test_every_reference_is_to_something_declared(compose: Compose) -> None:
    for name, service in compose.services.items():
        assert set(service.networks) <= set(compose.networks), name
        assert set(service.depends_on) <= set(compose.services), name
        for needed, dependency in service.depends_on.items():
            if dependency.condition == "service_healthy" and needed != "server":  # its image has the check
                assert compose.services[needed].healthcheck is not None, needed
        for volume in service.volumes:
            source = volume.split(":")[0]
            assert source in compose.volumes or (REPOSITORY / source).is_file(), volume


def test_every_container_is_hardened(compose: Compose) -> None:
    for name, service in compose.services.items():
        assert service.read_only, name
        assert service.cap_drop == ["ALL"], name
        assert service.security_opt == ["no-new-privileges:true"], name
        assert name == "proxy" or (service.user and not service.user.startswith("0")), name
        assert re.search(EXACT, service.image), f"{name}: {service.image} is a tag that moves"


def test_the_proxy_alone_is_open_and_the_database_cannot_be_reached_from_outside(compose: Compose) -> None:
    assert [name for name, service in compose.services.items() if service.ports] == ["proxy"]
    assert compose.services["database"].networks == ["inside"]
    assert compose.networks["inside"].internal


def test_variables_are_those_of_the_example_and_no_secret_has_a_default(compose: Compose) -> None:
    used = set(re.findall(r"\$\{([A-Z0-9_]+)", PATH.read_text(encoding="utf-8")))
    example = (REPOSITORY / "deploy" / "example.env").read_text(encoding="utf-8")
    used.add("COMPOSE_PROFILES")  # read by docker compose itself
    assert used == set(re.findall(r"^([A-Z0-9_]+)=", example, flags=re.MULTILINE))
    for secret in ("POSTGRES_PASSWORD", "METRICS_TOKEN", "AWS_SECRET_ACCESS_KEY"):
        assert re.search(rf"^{secret}=$", example, flags=re.MULTILINE)


def test_the_environment_of_the_server_is_one_of_settings(compose: Compose) -> None:
    from server.core.settings import Settings

    known = {f"PALPEBRA_{name.upper()}" for name in Settings.model_fields} | {
        "DATABASE_URL",
        "FORWARDED_ALLOW_IPS",
    }
    given = set(compose.services["server"].environment)
    assert {name for name in given if not name.startswith("AWS_")} <= known


def test_docker_itself_accepts_the_file() -> None:
    docker = shutil.which("docker")
    if docker is None or subprocess.run([docker, "compose", "version"], capture_output=True).returncode:
        pytest.skip("no `docker compose` on this machine")
    environment = {"PATH": "/usr/bin:/bin", "DOMAIN": "x.example", "POSTGRES_PASSWORD": "x"}
    command = [docker, "compose", "-f", str(PATH), "config", "--quiet"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
