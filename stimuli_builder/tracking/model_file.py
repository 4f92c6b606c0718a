"""The coupled model as a file."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from experiments.errors import InputError
from experiments.files import whole_file
from stimuli_builder.tracking.mesh import mesh_from
from stimuli_builder.tracking.model import CoupledModel
from stimuli_builder.tracking.shapes import LidMarkers

FORMAT = 2
ARRAYS = (
    "shape_modes",
    "appearance",
    "weights",
    "sd",
    "examples",
    "poses",
    "patches",
    "patch_frames",
    "patch_corners",
    "residual_limits",
    "usual_residuals",
    "point_errors",
    "error_slope",
)


def save_model(model: CoupledModel, path: Path) -> None:
    """Write the model as .npz without pickled objects."""
    facts = {
        "format": FORMAT,
        "size_px": list(model.size_px),
        "reduction": model.reduction,
        "mid_upper": model.markers.upper,
        "mid_lower": model.markers.lower,
        "mode_counts": model.mode_counts,
        "variance_kept": model.variance_kept,
    }
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(
            stream,
            facts=np.array(json.dumps(facts)),
            vertices=model.mesh.vertices,
            triangles=model.mesh.triangles,
            eye_of=model.mesh.eye_of,
            **{name: getattr(model, name) for name in ARRAYS},
        )


def load_model(path: Path) -> CoupledModel:
    """Read a model written by `save_model`; InputError if it is something else."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            facts = json.loads(str(stored["facts"]))
            arrays = {name: stored[name] for name in ARRAYS}
            mesh = mesh_from(stored["vertices"], stored["triangles"], stored["eye_of"])
    except FileNotFoundError as error:
        raise InputError(
            f"{path}: expected a model file, found none; make one with 'stimuli train'"
        ) from error
    except Exception as error:
        raise InputError(f"{path}: not a model that 'stimuli train' wrote") from error
    if facts.get("format") != FORMAT:
        raise InputError(
            f"{path}: model format {facts.get('format')}, this program reads {FORMAT}; train it again"
        )
    return CoupledModel(mesh=mesh, **arrays, **_facts(facts))


def _facts(facts: dict[str, Any]) -> dict[str, Any]:
    upper, lower = (tuple(tuple(eye) for eye in facts[key]) for key in ("mid_upper", "mid_lower"))
    return {
        "size_px": tuple(facts["size_px"]),
        "reduction": int(facts["reduction"]),
        "markers": LidMarkers(upper, lower),
        "mode_counts": tuple(facts["mode_counts"]),
        "variance_kept": tuple(facts["variance_kept"]),
    }
