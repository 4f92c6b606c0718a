"""The order of columns until 0.2, which exports use on request (new columns were then added at the end).

It is complete: columns that are not listed are newer and follow those that are.
"""

from collections.abc import Iterable

from experiments.columns.column import Column

_TRIAL = """
study experiment definition_sha256 phase synthetic run participant run_status language
trial_index kind block block_label play
"""
_CLIP = """
levels cell exemplar profile_id stimulus clip_sha256
"""
_ANSWERED = """
rt rt_from_first_frame time_elapsed changes comment method verdict verdict_rule
key_to_first_frame_ms frames_drawn frames_late frames_missing longest_gap_ms stalls focus_lost
refresh_rate_hz device_pixel_ratio px_per_mm viewing_distance_mm excluded exclusion_reason
saved_at run_origin study_version data_series clock_gap_ms clock_late_ms
"""
_OF_TABLE = {
    "ratings": f"""{_TRIAL}
{_CLIP} response expected_response {_ANSWERED} scale not_applicable scale_rt views
view_outcomes disturbances evidence_verdict check_response onset_delay_ms onset_uncertainty_ms
reference reference_gap_ms
""",
    "comparisons": f"""{_TRIAL}
left_cell left_exemplar left_stimulus left_clip_sha256 right_cell right_exemplar right_stimulus
right_clip_sha256 reference winner arrangement expected_response {_ANSWERED} views
view_outcomes disturbances evidence_verdict check_response onset_delay_ms onset_uncertainty_ms
""",
    "thresholds": f"""{_TRIAL}
series position value interval {_CLIP} response correct expected_response counts known ahead
threshold threshold_sd spread entropy {_ANSWERED} views view_outcomes disturbances
evidence_verdict check_response onset_delay_ms onset_uncertainty_ms
""",
    "traces": f"""{_TRIAL}
{_CLIP} response expected_response trace step_frames clip_fps moves blinks_s {_ANSWERED} views
view_outcomes disturbances check_response onset_delay_ms onset_uncertainty_ms evidence_verdict
""",
    "runs": """
study run participant phase synthetic status stage language version definition_sha256 seed slot
started_at consented_at completed_at trials excluded exclusion_reason erased forms device
run_origin data_series group_name evidence_verdict evidence_points evidence_tickets
evidence_digests evidence_clip_time evidence_claimed_time evidence_order evidence_late
evidence_interaction evidence_trusted evidence_press_ms evidence_press_spread
evidence_rt_median evidence_rt_spread evidence_same_answer evidence_cycle evidence_checks
evidence_motion_checks evidence_motion_checks_asked evidence_motion_checks_guessed
evidence_motion_checks_other_way evidence_motion_checks_void evidence_checks_guessed
calibration_method calibration_repeats calibration_spread calibration_ruler calibration_recheck
distance_method distance_spread_mm distance_typed_mm
""",
}
OLD_ORDER = {table: tuple(names.split()) for table, names in _OF_TABLE.items()}


def in_old_order(table: str, columns: Iterable[Column]) -> tuple[Column, ...]:
    """The columns of a table as they stood until 0.2; those of a younger table as they are."""
    position_before = {name: index for index, name in enumerate(OLD_ORDER.get(table, ()))}
    return tuple(sorted(columns, key=lambda column: position_before.get(column.name, len(position_before))))
