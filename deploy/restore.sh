#!/bin/sh
# Bring a backup back: deploy/restore.sh palpebra-2026-01-31T030000.tar (a name in the volume `backups`).
# What follows the name is an option of `server restore`, such as --despite-erasures.
# The database and the secret key there are get another name first; where the restore fails they get theirs back.
set -eu
[ $# -ge 1 ] || { echo "usage: deploy/restore.sh NAME.tar [OPTION...]" >&2; exit 2; }
name=$1
shift
before=palpebra_before_$(date -u +%Y%m%dT%H%M%S | tr A-Z a-z)
sql() { docker compose exec -T database psql -q -v ON_ERROR_STOP=1 -U palpebra -d postgres -c "$1"; }
in_data() { docker compose run --rm --no-deps -T --entrypoint sh server -c "$1"; }
put_back() {
    echo "the restore failed; everything is put back as it was" >&2
    sql 'DROP DATABASE IF EXISTS palpebra'
    sql "ALTER DATABASE $before RENAME TO palpebra"
    in_data "test ! -f data/secret_key.$before || mv data/secret_key.$before data/secret_key"
    docker compose up -d
    exit 1
}
docker compose stop server backup
docker compose up -d --wait database
in_data "test ! -f data/secret_key || mv data/secret_key data/secret_key.$before"
sql "ALTER DATABASE palpebra RENAME TO $before" || {
    in_data "test ! -f data/secret_key.$before || mv data/secret_key.$before data/secret_key"
    docker compose up -d
    exit 1
}
sql 'CREATE DATABASE palpebra' || put_back
docker compose run --rm --no-deps -T -v palpebra_backups:/app/backups:ro server restore "backups/$name" "$@" || put_back
docker compose up -d
echo "restored. What there was before is kept as the database $before; once all is well remove it:"
echo "    docker compose exec database dropdb -U palpebra $before"
