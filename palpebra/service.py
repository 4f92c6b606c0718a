"""`palpebra service`: a systemd unit for this installation and this data folder."""

import shutil
import sys
from pathlib import Path
from typing import Annotated

import typer

from experiments.errors import InputError
from palpebra.folders import PORT, Folder, data_folder

UNIT = """\
# Written by `palpebra service`. The server under systemd, as you, with access to its data folder only.
[Unit]
Description=Palpebra rating studies
After=network-online.target
Wants=network-online.target

[Service]
Environment=PALPEBRA_DATA_FOLDER={folder}
Environment=PALPEBRA_PUBLIC_URL={public_url}
Environment=FORWARDED_ALLOW_IPS=127.0.0.1
ExecStart={program} server run --port {port}
Restart=always
RestartSec=2
TimeoutStopSec=30
UMask=0077
ProtectSystem=strict
ReadWritePaths={folder}
PrivateTmp=true
NoNewPrivileges=true

[Install]
WantedBy={target}
"""


def register(parent: typer.Typer) -> None:
    """Add the command."""
    parent.command("service")(service)


def service(
    folder: Folder = None,
    domain: Annotated[str, typer.Option(help="Name of the server, such as lab.example.org.")] = "",
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port behind the proxy.")] = PORT,
    out: Annotated[Path | None, typer.Option(help="File to write; your systemd folder by default.")] = None,
) -> None:
    """Write a systemd unit that runs the server, and print the commands that enable it.

    Example: palpebra service --domain lab.example.org
    """
    program = shutil.which("palpebra") or f"{sys.executable} -m palpebra"
    place = data_folder(folder)
    if " " in str(place):
        raise InputError(
            f"folder {place}: expected a path without blanks for systemd; choose another by --folder"
        )
    own = out or Path.home() / ".config" / "systemd" / "user" / "palpebra.service"
    public_url = f"https://{domain}" if domain else f"http://localhost:{port}"
    target = "default.target" if out is None else "multi-user.target"
    own.parent.mkdir(parents=True, exist_ok=True)
    text = UNIT.format(folder=place, public_url=public_url, program=program, port=port, target=target)
    own.write_text(text, encoding="utf-8")
    typer.echo(f"Written: {own}")
    if out is None:
        typer.echo("Enable it: systemctl --user daemon-reload && systemctl --user enable --now palpebra")
    if domain:
        typer.echo(
            f"Put a proxy in front, for example: caddy reverse-proxy --from {domain} --to localhost:{port}"
        )
