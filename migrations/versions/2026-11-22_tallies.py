"""Counts of each run, filled from the ratings that are stored; indices for long lists of runs."""

import json
from array import array
from base64 import b64encode
from itertools import groupby
from sys import byteorder

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None

INDICES = {
    "ix_study_runs_study_id_id": ["study_id", "id"],
    "ix_study_runs_study_id_origin_status": ["study_id", "origin", "status", "stage", "completed_at"],
}
RUNS_AT_ONCE = 200
# Frozen as of this revision: server/participation/tallies.py may change, what is stored here may not.
LETTERS = {"good": "g", "uncertain": "u", "flagged": "f", "failed": "x"}
BETTER = {".": 0, "x": 1, "f": 2, "u": 3, "g": 4}
CODES = {"left": 1, "right": 2, "tie": 3}
PLAYS = """
SELECT t.study_run_id AS run, t.trial_index AS trial, t.play AS play, a.kind AS part, t.kind AS kind,
       CAST(t.payload AS TEXT) AS payload, t.verdict AS verdict, t.verdict_rule AS rule, t.method AS method,
       t.rt AS rt, t.key_to_first_frame_ms AS onset, r.version_id AS version, c.role AS role,
       c.version_clip_id AS clip
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
LEFT JOIN trial_clips c ON c.study_run_id = t.study_run_id AND c.trial_index = t.trial_index
WHERE t.study_run_id > :after AND t.study_run_id <= :last
ORDER BY t.study_run_id, t.trial_index, t.play
"""


def upgrade() -> None:
    for name, columns in INDICES.items():
        op.create_index(name, "study_runs", columns)
    op.create_table(
        "run_tallies",
        sa.Column("study_run_id", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("heat", sa.Text(), nullable=False),
        sa.Column("not_good", sa.Integer(), nullable=False),
        sa.Column("counts", sa.Text(), nullable=False),
        sa.Column("answers", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(
            ["study_run_id"], ["study_runs.id"], name=op.f("fk_run_tallies_study_run_id"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("study_run_id", name=op.f("pk_run_tallies")),
    )
    fill(op.get_bind())


def downgrade() -> None:
    op.drop_table("run_tallies")
    for name in INDICES:
        op.drop_index(name, "study_runs")


def fill(connection):
    tallies = sa.table("run_tallies", *(sa.column(name) for name in ("study_run_id", *counted([], {}))))
    runs = connection.scalars(sa.text("SELECT id FROM study_runs ORDER BY id")).all()
    versions, after = numbered(connection), 0
    for place in range(0, len(runs), RUNS_AT_ONCE):
        last = runs[min(place + RUNS_AT_ONCE, len(runs)) - 1]
        rows = connection.execute(sa.text(PLAYS), {"after": after, "last": last}).all()
        made = [
            {"study_run_id": run, **counted(list(plays), versions)}
            for run, plays in groupby(rows, key=lambda row: row.run)
        ]
        if made:
            connection.execute(tallies.insert(), made)
        after = last


def numbered(connection):
    """Clip -> its number in its version and that of its cell."""
    clips = connection.execute(sa.text("SELECT version_id, id, cell FROM version_clips ORDER BY version_id, id"))
    places = {}
    for _, members in groupby(clips, key=lambda row: row.version_id):
        cells = {}
        for number, (_, clip, cell) in enumerate(members):
            places[clip] = number, cells.setdefault(cell, len(cells))
    return places


def counted(rows, places):
    heat, not_good, plays, times, onsets, cells, answers = "", 0, {}, {}, [], {}, {}
    for _, members in groupby(rows, key=lambda row: (row.trial, row.play)):
        shown = list(members)
        row = shown[0]
        heat = heat.ljust(row.trial + 1, ".")
        letter = LETTERS[row.verdict]
        if BETTER[letter] > BETTER[heat[row.trial]]:
            heat = heat[: row.trial] + letter + heat[row.trial + 1 :]
        not_good += row.verdict in ("flagged", "failed")
        if row.part != "main":
            continue
        key = f"{row.verdict} {row.method} {row.rule}"
        plays[key] = plays.get(key, 0) + 1
        found = answer(row.kind, json.loads(row.payload), {one.role: places[one.clip] for one in shown if one.role})
        if row.verdict == "failed" or found is None:
            continue
        if row.rt is not None:
            times[str(int(row.rt // 250))] = times.get(str(int(row.rt // 250)), 0) + 1
        if row.onset is not None:
            onsets = onsets or [0] * 11
            onsets[min(int(row.onset // 10), 10)] += 1
        scale, clip, second, value, cell = found
        answers.setdefault(scale, array("Q")).append((clip << 18 | second) << 28 | (1000 * value + (1 << 27)))
        if cell is not None:
            sums = cells.setdefault(scale, [])
            sums.extend([0] * (2 * cell + 2 - len(sums)))
            sums[2 * cell] += 1
            sums[2 * cell + 1] += 1000 * value
    counts = {"plays": plays, "times": times, "onsets": onsets, "cells": cells}
    return {
        "heat": heat,
        "not_good": not_good,
        "counts": json.dumps(counts, separators=(",", ":")),
        "answers": json.dumps({scale: packed(codes) for scale, codes in answers.items()}, separators=(",", ":")),
    }


def answer(kind, payload, places):
    """Scale, clip, second clip, value and cell; None where no answer was given, or of a kind that has none here."""
    if kind == "clip_rating" and payload["response"] is not None:
        return "rating", places["shown"][0], 0, payload["response"], places["shown"][1]
    code = CODES.get(payload.get("winner")) if kind == "paired_comparison" else None
    if code is None:
        return None
    first, second = (places[role][0] for role in ("left", "first", "right", "second") if role in places)
    return "", first, second + 1, code, None


def packed(codes):
    if byteorder == "big":
        codes.byteswap()
    return b64encode(codes.tobytes()).decode()
