"""nginx as `deploy/nginx.conf` has it, on this machine's loopback: a folder of its own, gone at the end."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

from tools.load_server import ROOT, free_port

START_S = 20.0
_TEMPORARY = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")


class Nginx:
    """A running one: where it listens, and what it costs."""

    def __init__(self, port: int, process: subprocess.Popen[bytes]) -> None:
        self.port, self._process = port, process

    def cpu_s(self) -> float:
        """Processor time of all its processes so far."""
        first = psutil.Process(self._process.pid)
        return sum(sum(one.cpu_times()[:2]) for one in (first, *first.children()))


def nginx_program() -> str | None:
    """Where it is; None where this machine has none."""
    return shutil.which("nginx", path=f"{os.environ.get('PATH', '')}:/usr/sbin:/usr/local/sbin")


def site(server_port: int, port: int, cache: Path) -> str:
    """`deploy/nginx.conf` for loopback: without TLS, with its own folder for clips."""
    text = (ROOT / "deploy" / "nginx.conf").read_text(encoding="utf-8")
    text = re.sub(r"listen 443 ssl", f"listen 127.0.0.1:{port}", text)
    text = re.sub(r"\n *ssl_certificate\w* [^;]+;", "", text)
    return text.replace("127.0.0.1:8000", f"127.0.0.1:{server_port}").replace(
        "/var/cache/nginx/palpebra", str(cache)
    )


def configuration(folder: Path, server_port: int, port: int) -> Path:
    """Write the whole configuration into a folder; return its file."""
    (folder / "site.conf").write_text(site(server_port, port, folder / "clips"), encoding="utf-8")
    temporary = "\n".join(f"  {name}_temp_path {folder / name};" for name in _TEMPORARY)
    # Its workers give up root's rights, unless told not to, and could not read the folder then.
    user = "user root;\n" if hasattr(os, "geteuid") and os.geteuid() == 0 else ""
    path = folder / "nginx.conf"
    path.write_text(
        f"{user}worker_processes auto;\npid {folder / 'pid'};\nerror_log {folder / 'error.log'};\n"
        f"events {{ worker_connections 1024; }}\n"
        f"http {{\n{temporary}\n  include {folder / 'site.conf'};\n}}\n",
        encoding="utf-8",
    )
    return path


@contextmanager
def nginx(program: str, folder: Path, server_port: int) -> Iterator[Nginx]:
    """A started one in front of a server."""
    port = free_port()
    path, log = configuration(folder, server_port, port), folder / "error.log"
    command = [program, "-p", str(folder), "-c", str(path), "-e", str(log), "-g", "daemon off;"]
    process = subprocess.Popen(command)
    try:
        _wait(process, port, log)
        yield Nginx(port, process)
    finally:
        process.terminate()
        process.wait(10)


def _wait(process: subprocess.Popen[bytes], port: int, log: Path) -> None:
    ends = time.monotonic() + START_S
    while time.monotonic() < ends and process.poll() is None:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    raise RuntimeError(f"nginx did not start; it said:\n{log.read_text() if log.exists() else ''}")
