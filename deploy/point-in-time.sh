#!/bin/sh
# The database as it was at a moment (UTC): deploy/point-in-time.sh 2026-11-23T10:15:00Z
# Needs the archive that COMPOSE_PROFILES=point-in-time keeps. Where it fails everything is put back as it was.
set -eu
[ $# -eq 1 ] || { echo "usage: deploy/point-in-time.sh 2026-11-23T10:15:00Z" >&2; exit 2; }
export COMPOSE_PROFILES=point-in-time
before=before-$(date -u +%Y%m%dT%H%M%SZ)
clusters=/database/18
archive() { docker compose run --rm --no-deps -T -v palpebra_database:/database archive "$@"; }
in_archive() { docker compose run --rm --no-deps -T -v palpebra_database:/database --entrypoint sh archive -c "$1"; }
in_recovery() { docker compose exec -T database psql -qAtX -U palpebra -d postgres -c 'SELECT pg_is_in_recovery()'; }
recovered() {
    docker compose up -d --wait database || return 1
    tries=0
    until [ "$(in_recovery)" = f ]; do
        tries=$((tries + 1))
        [ "$tries" -lt "${RECOVERY_TRIES:-600}" ] || return 1
        sleep 1
    done
}
docker compose stop server backup
docker compose stop archive
archive restore "$1" "$clusters/then" || { docker compose up -d; exit 1; }
docker compose stop database
in_archive "mv $clusters/docker $clusters/$before && mv $clusters/then $clusters/docker"
recovered || {
    echo "the recovery failed (docker compose logs database); everything is put back as it was" >&2
    docker compose stop database || true
    in_archive "rm -rf $clusters/docker && mv $clusters/$before $clusters/docker"
    docker compose up -d
    exit 1
}
# The archive goes on from here; what it held of later moments belongs to a past that is over.
archive aside
docker compose run --rm --no-deps -T server database erase-again
docker compose up -d
echo "the database is as it was at $1. What there was before is kept; once all is well remove it:"
echo "    docker compose exec database rm -rf /var/lib/postgresql/18/$before"
echo "    docker compose exec archive sh -c 'rm -rf \"\$ARCHIVE\"/before-*'"
