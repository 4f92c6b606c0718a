#!/bin/sh
# Point in time on PostgreSQL: a base backup a week and every change since, and the database as it was at a moment.
#   archive.sh keep                    keeps both in $ARCHIVE until told to stop; connects by PGHOST, PGUSER...
#   archive.sh restore TIME FOLDER     makes the data folder of that moment (UTC, such as 2026-11-23T10:15:00Z)
#   archive.sh aside                   begins an empty archive; the old one is kept as $ARCHIVE/before-NOW
set -eu
umask 077
export LC_ALL=C
SLOT=palpebra_archive
: "${ARCHIVE:?the folder of the archive}"

now() { date -u +%Y%m%dT%H%M%SZ; }
sql() { psql -qAtX -v ON_ERROR_STOP=1 -d "${PGDATABASE:-postgres}" -c "$1"; }
bases() { ls "$ARCHIVE/base" 2>/dev/null || true; }
refuse() { echo "error: $1" >&2; exit 2; }

# The name of a base is the moment from which on it serves; those beyond $BASES go, and changes before them.
take_base() {
    rm -rf "$ARCHIVE/new"
    pg_basebackup -D "$ARCHIVE/new" -F tar -z -X none -c fast 2>/dev/null || return 1
    mv "$ARCHIVE/new" "$ARCHIVE/base/$(now)" || return 1
    bases | sort -r | tail -n "+$((${BASES:-2} + 1))" | while read -r old; do rm -rf "$ARCHIVE/base/$old"; done
    pg_archivecleanup "$ARCHIVE/wal" "$(first_segment "$(bases | sort | head -n 1)")"
    echo "base backup $(bases | sort | tail -n 1)"
}

first_segment() {
    tar -xzOf "$ARCHIVE/base/$1/base.tar.gz" backup_label | sed -n 's/^START WAL LOCATION.*file \([0-9A-F]*\)).*/\1/p'
}

base_is_due() {
    newest=$(bases | sort | tail -n 1)
    [ -z "$newest" ] || [ -n "$(find "$ARCHIVE/base/$newest" -prune -mmin "+${BASE_EVERY_MIN:-10080}")" ]
}

# Without its slot the archive has a gap: it begins anew. No answer is not the same as no slot.
begin_slot() {
    state=$(sql "SELECT coalesce(wal_status, 'new') FROM pg_replication_slots WHERE slot_name = '$SLOT'") || return 1
    case $state in
    "") ;;
    lost) sql "SELECT pg_drop_replication_slot('$SLOT')" >/dev/null || return 1 ;;
    *) return 0 ;;
    esac
    pg_receivewal -D "$ARCHIVE/wal" -S "$SLOT" --create-slot || return 1
    rm -rf "$ARCHIVE/base"/* "$ARCHIVE/wal"/*
}

keep() {
    mkdir -p "$ARCHIVE/base" "$ARCHIVE/wal"
    receiver=
    trap '[ -z "$receiver" ] || kill "$receiver" 2>/dev/null; exit 0' TERM INT
    while :; do
        if [ -z "$receiver" ] || ! kill -0 "$receiver" 2>/dev/null; then
            begin_slot && { pg_receivewal -D "$ARCHIVE/wal" -S "$SLOT" --no-loop & receiver=$!; } ||
                echo "the database does not answer; the next try is in ${LOOK_EVERY_S:-60} s" >&2
        fi
        ! base_is_due || take_base || echo "the base backup failed; the next try is in ${LOOK_EVERY_S:-60} s" >&2
        # Recovery stops at a commit after the moment: on a quiet night there would be none.
        sql "SELECT pg_current_xact_id()" >/dev/null 2>&1 || true
        sleep "${LOOK_EVERY_S:-60}" &
        wait $! || true
    done
}

restore() {
    time=$1 folder=$2
    echo "$time" | grep -Eqx '[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}([.][0-9]+)?Z' ||
        refuse "expected a moment in UTC such as 2026-11-23T10:15:00Z, got '$time'"
    moment=$(echo "$time" | tr -d ':-' | sed 's/[.].*Z/Z/')
    [ ! -e "$folder" ] || refuse "$folder: expected a folder that is not there yet"
    base=$({ bases; echo "$moment~"; } | sort | sed "/^$moment~\$/q" | sed '$d' | tail -n 1)
    [ -n "$base" ] || refuse "$time: the archive begins at $(bases | sort | head -n 1 | grep . || echo 'no moment: it is empty')"
    [ "$(printf '%s\n' "$moment" "$(now)" | sort | head -n 1)" = "$moment" ] || refuse "$time: this moment is still to come"
    mkdir -m 700 "$folder" "$folder/archived"
    tar -xzf "$ARCHIVE/base/$base/base.tar.gz" -C "$folder"
    rm -f "$folder"/.s.PGSQL.*.lock  # where sockets lie in the data folder
    copy_changes "$(first_segment "$base")" "$folder/archived"
    cat >>"$folder/postgresql.auto.conf" <<CONF
restore_command = 'cp archived/%f %p'
recovery_end_command = 'rm -rf archived'
recovery_target_time = '$(echo "$time" | sed 's/T/ /; s/Z/+00/')'
recovery_target_action = 'promote'
CONF
    : >"$folder/recovery.signal"
    echo "$folder: from the base of $base on; start PostgreSQL on it"
}

# All from that segment on, of any timeline; the last one is still being written and has another name.
copy_changes() {
    for file in "$ARCHIVE/wal"/*; do
        name=$(basename "$file" .partial)
        case $name in
        *.history) cp "$file" "$2/" ;;
        *) [ "$(printf '%s\n' "$name" "$1" | cut -c9- | sort | head -n 1)" != "$(echo "$1" | cut -c9-)" ] || cp "$file" "$2/$name" ;;
        esac
    done
}

aside() {
    before="$ARCHIVE/before-$(now)"
    mkdir "$before"
    for part in base wal; do [ ! -e "$ARCHIVE/$part" ] || mv "$ARCHIVE/$part" "$before/"; done
    echo "the archive so far is kept as $before"
}

case "${1:-} $#" in
"keep 1") keep ;;
"restore 3") restore "$2" "$3" ;;
"aside 1") aside ;;
*) sed -n '2,5s/^# //p' "$0" >&2; exit 2 ;;
esac
