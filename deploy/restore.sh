#!/bin/sh
# Bring a backup back: deploy/restore.sh palpebra-2026-01-31T030000.tar (a name in the volume `backups`).
# The database must be empty: on a fresh machine it is; elsewhere give the old one another name first.
set -eu
[ $# -eq 1 ] || { echo "usage: deploy/restore.sh NAME.tar" >&2; exit 2; }
docker compose stop server backup
docker compose up -d --wait database
docker compose run --rm --no-deps -v palpebra_backups:/app/backups:ro server restore "backups/$1"
docker compose up -d
