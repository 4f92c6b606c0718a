"""`palpebra service`: a systemd unit for this installation and this data folder."""

import shutil
import sys
from pathlib import Path
from typing import Annotated

import typer

from experiments.errors import InputError
from palpebra.folders import PORT, Folder, data_folder
from palpebra.https import check_name

UNIT = """\
# Written by `palpebra service install`. The server under systemd, with access to its data folder only.
[Unit]
Description=Palpebra rating studies
After=network-online.target
Wants=network-online.target

[Service]
Environment=PALPEBRA_DATA_FOLDER={folder}
{environment}ExecStart={program} {command}
Restart=always
RestartSec=2
TimeoutStopSec=30
UMask=0077
ProtectSystem=strict
ReadWritePaths={folder}
PrivateTmp=true
NoNewPrivileges=true
{capabilities}
[Install]
WantedBy={target}
"""
MAY_LISTEN = """\
# Caddy listens on ports 80 and 443.
AmbientCapabilities=CAP_NET_BIND_SERVICE
"""
LOW_PORTS = "sudo setcap cap_net_bind_service=+ep $(command -v caddy)"


def register(parent: typer.Typer) -> None:
    """Add the commands."""
    service = typer.Typer(no_args_is_help=True, help="Run the server as a systemd service.")
    service.command("install")(install)
    parent.add_typer(service, name="service")


def install(
    folder: Folder = None,
    domain: Annotated[str, typer.Option(help="Name of the server, such as lab.example.org.")] = "",
    own_proxy: Annotated[
        bool, typer.Option("--own-proxy", help="Another proxy, such as nginx, gives https for the domain.")
    ] = False,
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the server.")] = PORT,
    out: Annotated[
        Path | None,
        typer.Option(help="File of a unit for the whole system; by default it is a unit of your account."),
    ] = None,
) -> None:
    """Write a systemd unit that runs the server, and print the commands that enable it.

    With --domain the unit runs `palpebra serve`, which gets a certificate.

    Examples:

        palpebra service install

        palpebra service install --domain lab.example.org
    """
    if domain:
        check_name(domain, is_public=not own_proxy)
    elif own_proxy:
        raise InputError("--own-proxy is for a domain: expected --domain NAME with it")
    program = shutil.which("palpebra") or f"{sys.executable} -m palpebra"
    place = data_folder(folder)
    if " " in str(place):
        raise InputError(
            f"folder {place}: expected a path without blanks for systemd; choose another by --folder"
        )
    has_caddy = bool(domain) and not own_proxy
    environment = ""
    if has_caddy:
        command = f"serve --domain {domain} --port {port}"
    else:
        public_url = f"https://{domain}" if domain else f"http://localhost:{port}"
        environment = f"Environment=PALPEBRA_PUBLIC_URL={public_url} FORWARDED_ALLOW_IPS=127.0.0.1\n"
        command = f"start --no-browser --port {port}"
    text = UNIT.format(
        folder=place,
        environment=environment,
        program=program,
        command=command,
        capabilities=MAY_LISTEN if has_caddy and out else "",
        target="multi-user.target" if out else "default.target",
    )
    own = out or Path.home() / ".config" / "systemd" / "user" / "palpebra.service"
    own.parent.mkdir(parents=True, exist_ok=True)
    own.write_text(text, encoding="utf-8")
    typer.echo(f"Written: {own}")
    if out is None:
        if has_caddy:
            typer.echo(f"Allow Caddy to use ports 80 and 443: {LOW_PORTS}")
        typer.echo("Enable it: systemctl --user daemon-reload && systemctl --user enable --now palpebra")
        typer.echo("Start it at boot, too: sudo loginctl enable-linger $USER")
