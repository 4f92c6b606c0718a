"""Make the report of a capsule again, from its declaration and its table of answers alone."""

from pathlib import Path

from analysis.plans.plan import plan_of
from analysis.plans.study import study_contents
from analysis.read.pool import Origin, Pool
from analysis.read.runs_file import read_runs
from analysis.read.study_answers import load_csv
from analysis.report.contents import Progress, held_against
from analysis.report.write import write_report
from experiments.capsule.declaration import MANIFEST, ReportSource
from experiments.capsule.packing import report_input
from experiments.load import load_experiment
from experiments.seal import read_clips_sha256, read_seal

ANSWERS = "answers.csv"
"""Name of the table while it is analysed, which stands in the report."""


def rebuild(source: ReportSource, folder: Path, work: Path, progress: Progress = lambda _: None) -> Path:
    """Write the report into `work`, an empty folder; return the folder of the report.

    Parameters
    ----------
    folder : Path
        Of the capsule's files, checked.
    """
    table, report = work / ANSWERS, work / "report"
    report_input(folder / source.answers, table, source.renamed)
    experiment = load_experiment(str(folder / source.definition), has_data=True)
    progress("reading answers")
    runs = read_runs(folder / source.runs)
    answers = load_csv(table, experiment, plan_of(experiment.trial.kind).reading)
    contents = study_contents(experiment, answers, Pool(Origin(source.origin), source.series), runs)
    if source.seal is not None:
        clips = read_clips_sha256(folder / MANIFEST)
        contents = held_against(contents, read_seal(folder / source.seal), experiment, clips)
    write_report(contents, report, more=source.sensitivity, progress=progress)
    return report
