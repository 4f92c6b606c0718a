#!/bin/sh
# A backup now and every BACKUP_EVERY_S seconds; those of the newest BACKUP_KEEP days stay. Ends at once when told to.
# With BACKUP_TO (a folder or s3://BUCKET/PREFIX) a second one goes there, encrypted for PALPEBRA_BACKUP_RECIPIENT.
set -eu
trap 'exit 0' TERM INT
while :; do
    python -m server backup "backups/palpebra-$(date -u +%Y-%m-%dT%H%M%S).tar" --keep "${BACKUP_KEEP:-14}" ||
        echo "backup failed; the next try is in ${BACKUP_EVERY_S:-86400} s" >&2
    [ -z "${BACKUP_TO:-}" ] || python -m server backup --to "$BACKUP_TO" --keep "${BACKUP_KEEP:-14}" ||
        echo "backup to $BACKUP_TO failed; the next try is in ${BACKUP_EVERY_S:-86400} s" >&2
    sleep "${BACKUP_EVERY_S:-86400}" &
    wait $!
done
