"""A study with several scales: a part of the report per scale, and how far they agree."""

import csv
import json
import random
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.plans.clip_rating import READING
from analysis.plans.plan import study_contents
from analysis.read.study_answers import load_csv
from analysis.report.contents import in_words
from analysis.report.write import write_report
from experiments import design
from experiments.kinds import scales_of
from experiments.kinds.clip_rating import RATINGS
from experiments.load import load_experiment
from tests.analysis.report.test_latex import well_formed
from tests.conftest import REPOSITORY

TOML = REPOSITORY / "experiments" / "sliders-demo.toml"
DEMO = load_experiment(str(TOML))
SCALES = scales_of(DEMO)
WITH_RULES = DEMO.model_copy(update={"exclusions": load_experiment("exp3").exclusions[:2]})


@pytest.fixture
def rows() -> list[dict[str, object]]:
    """Ratings that follow one liking of each clip, upside down on reverse-keyed scales."""
    rng, rows = random.Random(4), []
    liking = {clip: rng.gauss(0, 0.15) for clip in design.clips(DEMO)}
    for person in range(8):
        for index, (clip, like) in enumerate(liking.items()):
            own = like + rng.gauss(0, 0.1)
            for scale in SCALES:
                share = min(1.0, max(0.0, 0.5 + own + rng.gauss(0, 0.05)))
                share = 1 - share if scale.reverse else share
                given = scale.nearest(scale.minimum + share * (scale.maximum - scale.minimum))
                row: dict[str, object] = dict.fromkeys(RATINGS.csv_header(DEMO.factor_names), "")
                row |= {"study": "s", "experiment": DEMO.name, "synthetic": 1, "kind": "main", "play": 1}
                row |= {"run": f"r{person}", "participant": f"P{person}", "run_status": "complete"}
                row |= {"trial_index": index, "exemplar": clip.exemplar, "scale": scale.name, "rt": 900}
                row |= {"response": given, "verdict": "good", "excluded": 0, "run_origin": "simulated"}
                rows.append(row | dict(clip.levels) | {"study_version": 1, "data_series": 1})
    return rows


def write(path: Path, rows: list[dict[str, object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, RATINGS.csv_header(DEMO.factor_names))
        writer.writeheader()
        writer.writerows(rows)


def test_each_scale_has_its_part_and_all_their_reliability(tmp_path, rows) -> None:
    path = tmp_path / "r.csv"
    write(path, rows)
    out = tmp_path / "out"
    done = CliRunner().invoke(
        app, ["run", str(TOML), "--csv", str(path), "--out", str(out), "--no-sensitivity"]
    )
    assert done.exit_code == 0, done.output
    report = (out / "report.md").read_text(encoding="utf-8")
    assert all(f"## {in_words(scale.name)}" in report for scale in SCALES)
    assert (
        f"{in_words(SCALES[0].name)}: Mean ratings by condition, with tests of each factor, sliders_demo"
        in report
    )

    numbers = json.loads((out / "results.json").read_text(encoding="utf-8"))
    assert [one["scale"] for one in numbers["scales"]] == [scale.name for scale in SCALES]
    for one, scale in zip(numbers["scales"], SCALES, strict=True):
        mine = [float(row["response"]) for row in rows if row["scale"] == scale.name]
        main = [mean["mean"] for mean in one["marginal_means"] if mean["effect"] == DEMO.factor_names[0]]
        assert np.mean(main) == pytest.approx(np.mean(mine))
    assert numbers["cronbach_alpha"]["alpha"] == pytest.approx(alpha_of(rows))
    assert numbers["cronbach_alpha"]["alpha"] > 0.5
    figures = {path.name.split("-")[0]: path.read_text(encoding="utf-8") for path in out.glob("*.svg")}
    assert figures.keys() == {scale.name for scale in SCALES}
    assert "Naturalness (1 not at all – 5 very)" in figures["naturalness"]
    assert "Tiredness (0 wide awake – 100 very tired)" in figures["tiredness"]


def test_each_scale_has_its_companions_models_and_multiverse(tmp_path, rows) -> None:
    path, out, steps = tmp_path / "r.csv", tmp_path / "out", list[str]()
    write(path, rows)
    contents = study_contents(WITH_RULES, load_csv(path, WITH_RULES, READING))
    write_report(contents, out, more=True, progress=steps.append)
    text = (out / "report.md").read_text(encoding="utf-8")
    for title in ("Bayes factors", "Robust companions", "Linear mixed model", "Multiverse of exclusions"):
        assert text.count(f"### {title}") == len(SCALES)
    for scale in SCALES:
        assert f"{scale.name}: multiverse of exclusions" in steps
        assert (out / f"{scale.name}-figure-multiverse.png").is_file()
        assert (out / f"{scale.name}-mixed-verify.R").is_file()
    made = (out / "report.tex").read_text(encoding="utf-8")
    well_formed(made, out)
    for scale in SCALES:
        assert f"tab:{scale.name}-robust" in made
        assert f"fig:{scale.name}-figure-multiverse" in made
    page = (out / "report.html").read_text(encoding="utf-8")
    ids = re.findall(r' id="([^"]+)"', page)
    assert len(set(ids)) == len(ids)
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(ids)


def test_the_multiverse_of_a_scale_is_that_of_the_scale_alone(tmp_path, rows) -> None:
    path = tmp_path / "r.csv"
    write(path, rows)
    answers = load_csv(path, WITH_RULES, READING)
    among = study_contents(WITH_RULES, answers).parts[1].more(lambda _: None)
    alone = study_contents(WITH_RULES, answers, scale=SCALES[1].name).parts[0].more(lambda _: None)
    assert [table.rows for section in among for table in section.tables] == [
        table.rows for section in alone for table in section.tables
    ]


def alpha_of(rows: list[dict[str, object]]) -> float:
    """Cronbach's alpha by its definition: k / (k - 1) (1 - sum of variances / variance of the sum)."""
    turned = []
    for scale in SCALES:
        mine = [float(str(row["response"])) for row in rows if row["scale"] == scale.name]
        turned.append([scale.minimum + scale.maximum - x if scale.reverse else x for x in mine])
    table = np.array(turned)
    k = len(table)
    return k / (k - 1) * (1 - table.var(axis=1, ddof=1).sum() / table.sum(axis=0).var(ddof=1))


def report_of(tmp_path, rows, *options):
    path, out = tmp_path / "r.csv", tmp_path / "n.json"
    write(path, rows)
    done = CliRunner().invoke(
        app, ["run", "sliders_demo", "--csv", str(path), "--json", str(out), "--no-report", *options]
    )
    return done, json.loads(out.read_text(encoding="utf-8")) if done.exit_code == 0 else None


def test_one_scale_is_analysed_for_itself_by_its_name(tmp_path, rows) -> None:
    done, numbers = report_of(tmp_path, rows, "--scale", "eeriness")
    assert done.exit_code == 0, done.output
    assert "the scale eeriness alone, of 3" in " ".join(numbers["decisions"])
    mine = [float(row["response"]) for row in rows if row["scale"] == "eeriness"]
    main = [mean["mean"] for mean in numbers["marginal_means"] if mean["effect"] == DEMO.factor_names[0]]
    assert np.mean(main) == pytest.approx(np.mean(mine))
    _, whole = report_of(tmp_path, rows)
    of_all = next(one for one in whole["scales"] if one["scale"] == "eeriness")
    assert of_all["marginal_means"] == numbers["marginal_means"]


def test_an_unknown_scale_is_named_with_the_nearest(tmp_path, rows) -> None:
    done, _ = report_of(tmp_path, rows, "--scale", "eerines")
    assert done.exit_code != 0
    assert "has no scale 'eerines'; did you mean 'eeriness'?" in str(done.exception)


def test_left_out_counts_plays_and_answers_that_a_scale_does_not_apply(tmp_path, rows) -> None:
    first = [row for row in rows if row["run"] == "r0"]
    last = max(int(str(row["trial_index"])) for row in first)
    for row in first:
        if row["trial_index"] == 0 and row["scale"] == "tiredness":
            row |= {"response": "", "not_applicable": 1}
        if row["trial_index"] == last:
            row |= {"response": "", "verdict": "failed"}
    aside = report_of(tmp_path, rows)[1]["exclusions"]["set_aside"]
    assert aside == ["1 presentation without a rating", "1 answer of 'does not apply'"]
