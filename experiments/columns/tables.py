"""The tables behind a view: those of every answer, and a clip for each role in which a trial shows one."""

from collections.abc import Mapping

RUN_ALIASES = frozenset("rvs")
RUN_JOINS = "JOIN study_versions v ON v.id = r.version_id\nJOIN studies s ON s.id = r.study_id\n"
"""The tables of a run after `study_runs r`."""
CLIP_TABLE = "version_clips"


def rows_of(kind: str, clips: Mapping[str, str], further: str = "") -> str:
    """The SQL after SELECT of a view of the answers of one kind of trial.

    Parameters
    ----------
    kind : str
        As the declaration names it.
    clips : mapping of str to str
        Alias of `version_clips` for each role.
    further : str, optional
        Joins of the kind's own tables, or of the parts of an answer.
    """
    joins = "".join(
        f"LEFT JOIN trial_clips {role}_clip ON {role}_clip.study_run_id = t.study_run_id "
        f"AND {role}_clip.trial_index = t.trial_index AND {role}_clip.role = '{role}'\n"
        f"LEFT JOIN {CLIP_TABLE} {alias} ON {alias}.id = {role}_clip.version_clip_id\n"
        for role, alias in clips.items()
    )
    return f"""FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
{RUN_JOINS}{joins}{further}WHERE t.kind = '{kind}' AND r.origin <> 'preview' AND r.erased_at IS NULL
"""
