"""What `stimuli model` does."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from experiments.errors import InputError, counted, did_you_mean
from experiments.files import temporary_beside, whole_text
from stimuli_builder.blinks.blink_model import (
    TEXTBOOK_KINDS,
    BlinkModel,
    PhaseModel,
    default_model,
    textbook_profile,
)
from stimuli_builder.blinks.export import CurveTarget, check_format, make_curve, write_curve
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.plots import check_figure_name, model_figure, profiles_figure, save_figure
from stimuli_builder.blinks.profile import (
    BlinkProfile,
    read_profile_table,
    resample,
    to_full_closure,
    write_profile_table,
)

EYES = ("auto", "each", "both")
DEFAULT_COMPONENTS = 5


def fit_model(
    tables: Sequence[Path], out: Path | None, components: int | None, eyes: str, plot: Path | None, seed: int
) -> None:
    """Fit, report, write; see `stimuli model fit --help`."""
    if eyes not in EYES:
        raise InputError(f"unknown --eyes '{eyes}'{did_you_mean(eyes, EYES)}")
    _check_outputs(out, plot)
    training = training_profiles(tables, eyes)
    most = max(1, min(DEFAULT_COMPONENTS, len(training) - 1))
    model = BlinkModel.fit(training, components or most)
    if plot is not None:
        rng = np.random.default_rng(seed)
        save_figure(model_figure(model, training, [model.sample(rng=rng) for _ in range(20)]), plot)
    if out is not None:
        model.save(out)
    _report_fit(model, len(training))


def training_profiles(tables: Sequence[Path], eyes: str = "auto") -> list[BlinkProfile]:
    """Return the profiles to learn from: the tables', the shipped library's where there are none."""
    if tables:
        profiles = [
            replace(
                profile,
                profile_id=f"{table.stem}:{profile.profile_id}" if len(tables) > 1 else profile.profile_id,
            )
            for table in tables
            for profile in read_profile_table(table)
        ]
    else:
        profiles = [*load_library(), *load_library(paired=True)]
    pairs = [profile for profile in profiles if profile.closure_other is not None]
    together = eyes == "both" or (eyes == "auto" and bool(tables) and len(pairs) >= 3)
    if not together:
        return [profile for profile in profiles if profile.closure_other is None]
    if not pairs:
        raise InputError("--eyes both: no blink was seen in both eyes; label both columns in one call")
    return pairs


def _report_fit(model: BlinkModel, count: int) -> None:
    console = Console(markup=False)
    table = Table("component", "variance", "cumulative", "sd of coefficient", box=SIMPLE_HEAD)
    for index, share in enumerate(model.explained):
        total = float(model.explained[: index + 1].sum())
        table.add_row(str(index + 1), f"{share:.1%}", f"{total:.1%}", f"{model.coefficient_sd[index]:.3f}")
    console.print(table)
    eyes = "left and right together" if model.eyes == 2 else "one eye a profile"
    console.print(
        f"{count} profiles, {eyes}; mean phases {model.down_frames} + {model.up_frames} frames at 300 fps; "
        f"{model.coefficient_sd.size} components keep {model.variance_kept:.1%} of the variance"
    )


def sample_blinks(
    out: Path,
    count: int,
    duration: float | None,
    seed: int,
    model_path: Path | None,
    plot: Path | None,
    *,
    full_closure: bool,
    pca: bool = False,
) -> None:
    """Draw blinks and write their table; see `stimuli model sample --help`."""
    _check_outputs(out, plot)
    made = draw(_model(model_path, pca), count, duration, seed, full_closure=full_closure)
    if plot is not None:
        shown = [replace(p, source=p.profile_id) for p in made[:8]]
        save_figure(
            profiles_figure(shown, f"{counted(len(shown), 'blink')} made by the model, seed {seed}"), plot
        )
    write_profile_table(out, made)
    frames = [profile.duration_frames_30fps for profile in made]
    closures = [float(profile.closure.max()) for profile in made]
    Console(markup=False).print(
        f"{counted(count, 'blink')} of {min(frames):.1f} to {max(frames):.1f} frames at 30 fps, "
        f"closure {min(closures):.2f} to {max(closures):.2f}; wrote {out}"
    )


def draw(
    model: BlinkModel | PhaseModel,
    count: int,
    duration: float | None,
    seed: int,
    *,
    full_closure: bool = False,
) -> list[BlinkProfile]:
    """Draw `count` blinks, the n-th from a generator of its own: a greater count keeps the first ones."""
    made = []
    for number in range(1, count + 1):
        rng = np.random.default_rng([seed, number])
        blink = model.sample(duration, rng, profile_id=f"model-s{seed}-{number:03d}")
        made.append(to_full_closure(blink) if full_closure else blink)
    return made


def textbook_blinks(out: Path, duration: float, plot: Path | None) -> None:
    """Write the four textbook curves; see `stimuli model textbook --help`."""
    _check_outputs(out, plot)
    made = [textbook_profile(kind, duration) for kind in TEXTBOOK_KINDS]
    if plot is not None:
        model = to_full_closure(default_model().sample(duration, np.random.default_rng(1)))
        title = f"{duration:g} frames at 30 fps"
        save_figure(profiles_figure([replace(model, source="model"), *made], title), plot)
    write_profile_table(out, made)
    Console(markup=False).print(f"{len(made)} textbook curves of {duration:g} frames at 30 fps; wrote {out}")


@dataclass(frozen=True)
class ExportJob:
    """One call of `stimuli model export`; the fields are its options."""

    out: Path
    format_name: str = "csv"
    fps: float | None = None
    count: int = 1
    duration: float | None = None
    seed: int = 1
    profile_names: tuple[str, ...] = ()
    profiles: Path | None = None
    model: Path | None = None
    pca: bool = False
    full_closure: bool = False
    lead_s: float = 0.0
    target: str = ""
    left: str = "eyeBlinkLeft"
    right: str = "eyeBlinkRight"

    @property
    def names(self) -> CurveTarget:
        """What the curve's object and shapes are called."""
        return CurveTarget(self.target, self.left, self.right)


def export_curve(job: ExportJob) -> None:
    """Write an animation curve; see `stimuli model export --help`."""
    _check_export(job)
    rate = job.fps or (300.0 if job.format_name in ("csv", "json") else 30.0)
    curve = make_curve(_export_profiles(job), rate, job.lead_s, job.seed)
    text = write_curve(job.format_name, curve, job.names)
    with whole_text(job.out) as stream:
        stream.write(text)
    Console(markup=False).print(
        f"{counted(len(curve.blinks), 'blink')}, {counted(curve.left.size, 'frame')} at {rate:g} fps; "
        f"wrote {job.out}"
    )


def _check_export(job: ExportJob) -> None:
    check_format(job.format_name, job.names)
    if sum([bool(job.profile_names), job.profiles is not None, job.model is not None]) > 1:
        raise InputError("blinks come from --profile, --profiles or --model: give one of them")
    _check_outputs(job.out, None)


def _export_profiles(job: ExportJob) -> list[BlinkProfile]:
    if job.profile_names:
        shipped = {p.profile_id: p for p in (*load_library(), *load_library(paired=True))}
        for name in job.profile_names:
            if name not in shipped:
                raise InputError(f"no shipped profile '{name}'{did_you_mean(name, shipped)}")
        chosen = [shipped[name] for name in job.profile_names]
    elif job.profiles is not None:
        chosen = read_profile_table(job.profiles)
    else:
        return draw(
            _model(job.model, job.pca), job.count, job.duration, job.seed, full_closure=job.full_closure
        )
    if job.duration is not None:
        chosen = [resample(profile, job.duration) for profile in chosen]
    return [to_full_closure(profile) for profile in chosen] if job.full_closure else chosen


def _model(path: Path | None, pca: bool) -> BlinkModel | PhaseModel:
    """The PCA model asked for, or the phases of the shipped profiles of one eye."""
    if path is not None:
        return BlinkModel.load(path)
    return default_model() if pca else PhaseModel.fit(training_profiles([], "each"))


def _check_outputs(out: Path | None, plot: Path | None) -> None:
    for path in (out, plot):
        if path is not None:
            temporary_beside(path)
    if plot is not None:
        check_figure_name(plot)
