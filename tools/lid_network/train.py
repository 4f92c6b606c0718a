"""Train the lid network on what `pictures.py` wrote; stopped, it goes on where it was.

    python -m tools.lid_network.train OUT_FOLDER EYES.npz... [--steps 3500] [--workers 2]

Needs torch (CPU), onnx and OpenCV, in an environment of their own. Writes `state.pt` (to go on from),
`lids.onnx`, and `card.json`, which says what it was trained on and how well it does on identities left out.
"""

import argparse
import json
import time
import warnings
from collections.abc import Iterator, Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from tools.lid_network.augment import EYE_PX, SIZE, example
from tools.lid_network.network import POINTS, SCALE, LidNetwork, contour_error, loss_of

BATCH, RATE = 64, 2e-3
LEFT_OUT = 7
"""One of so many identities is left out, to tell how well the network does on a face it has not seen."""
_SHARED: dict[str, Any] = {}
"""What each process that makes batches holds."""
SHARES = {"sample": 0.62, "actor": 0.13, "face": 0.25}


def kind_of(source: str) -> str:
    """What an eye comes from."""
    head = source.split()[0]
    return head if head in SHARES else "face"


class Eyes:
    """Cut-out eyes, drawn by the share of their kind and within it evenly over identities."""

    def __init__(self, files: Sequence[Path]) -> None:
        parts = [dict(np.load(file)) for file in files]
        self.data = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
        sources = [str(name).removesuffix("-face") for name in self.data["source"]]
        names = sorted(set(sources))
        left_out = {name for k, name in enumerate(names) if k % LEFT_OUT == 3}
        members = {name: [k for k, source in enumerate(sources) if source == name] for name in names}
        self.kept = {name: rows for name, rows in members.items() if name not in left_out}
        self.left_out = {name: rows for name, rows in members.items() if name in left_out}

    def draw(self, rng: np.random.Generator, left_out: bool = False) -> tuple[Any, ...]:
        """One training example: picture, 20 points, iris in eye widths, whether the iris is seen."""
        groups = self.left_out if left_out else self.kept
        kinds = {kind: [n for n in groups if kind_of(n) == kind] for kind in SHARES}
        odds = np.array([SHARES[kind] * bool(kinds[kind]) for kind in SHARES])
        kind = list(SHARES)[int(rng.choice(len(odds), p=odds / odds.sum()))]
        row = int(rng.choice(groups[str(rng.choice(kinds[kind]))]))
        visible = float(self.data["visible"][row])
        made = example(
            self.data["picture"][row], self.data["lids"][row], self.data["iris"][row], visible, rng
        )
        upper, lower = made.lids
        points = np.concatenate([upper[[0, -1]], upper[1:-1], lower[1:-1]])
        middle = (np.array(SIZE) - 1) / 2
        iris = np.array([*((made.iris[:2] - middle) / SCALE), np.log(made.iris[2] / EYE_PX)])
        return made.picture, (points - middle) / SCALE, iris, visible > 0.35

    def batch(
        self, rng: np.random.Generator, size: int = BATCH, left_out: bool = False
    ) -> list[NDArray[np.float32]]:
        """Examples side by side: pictures, points, irises, whether the iris is seen."""
        drawn = [self.draw(rng, left_out) for _ in range(size)]
        pictures, points, iris, seen = (np.array(part, np.float32) for part in zip(*drawn, strict=True))
        return [pictures[:, None], points, iris, seen]


def rate_at(share: float) -> float:
    """The rate of learning after a share of the steps: up, then down along a cosine."""
    return float(RATE * min(1.0, share / 0.03 + 0.05) * 0.5 * (1 + np.cos(np.pi * min(share, 1.0))) + 1e-6)


def batches(eyes: Eyes, seed: int, steps: range, workers: int) -> Iterator[list[NDArray[np.float32]]]:
    """The batch of each step, made by processes of their own; the same for any number of them."""
    context = get_context("fork")
    with context.Pool(workers, _begin, (eyes, seed)) as pool:
        yield from pool.imap(_batch, steps)


def _begin(eyes: Eyes, seed: int) -> None:
    _SHARED.update(eyes=eyes, seed=seed)


def _batch(step: int) -> list[NDArray[np.float32]]:
    eyes: Eyes = _SHARED["eyes"]
    return eyes.batch(np.random.default_rng([_SHARED["seed"], 1, step]))


def trained(eyes: Eyes, options: argparse.Namespace) -> tuple[LidNetwork, dict[str, Any]]:
    """Train for so many steps in all, those of stopped runs counted."""
    torch.manual_seed(options.seed)
    torch.set_num_threads(1)
    cv2.setNumThreads(1)  # before processes are forked: threads do not survive it
    network, state = begun(eyes, options.seed), options.out / "state.pt"
    optimiser = torch.optim.AdamW(network.parameters(), RATE, weight_decay=0.02)
    step, smooth = 0, 0.0
    if state.exists():
        stored = torch.load(state, weights_only=True)
        network.load_state_dict(stored["network"])
        optimiser.load_state_dict(stored["optimiser"])
        step, smooth = stored["step"], stored["smooth"]
    network.train()
    for batch in batches(eyes, options.seed, range(step, options.steps), options.workers):
        for group in optimiser.param_groups:
            group["lr"] = rate_at(step / options.steps)
        pictures, points, iris, seen = map(torch.from_numpy, batch)
        loss = loss_of(network(pictures), points, iris, seen)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        optimiser.step()
        step, smooth = step + 1, 0.98 * smooth + 0.02 * loss.item()
        if step % 50 == 0:
            print(f"{step} steps, loss {smooth:.3f}", flush=True)
            save(state, network, optimiser, step, smooth)
    return network, {"steps": step, "loss": round(smooth, 3), "processor_s": round(time.process_time())}


def begun(eyes: Eyes, seed: int) -> LidNetwork:
    """A network that answers the mean eye before it has learnt anything."""
    network = LidNetwork()
    mean = eyes.batch(np.random.default_rng([seed, 0]))[1].mean(0)
    last = network.head[-1]
    with torch.no_grad():
        last.weight.mul_(0.1)
        last.bias[: 2 * POINTS] = torch.from_numpy(mean.reshape(-1))
        last.bias[2 * POINTS + 2] = -1.5
        last.bias[2 * POINTS + 3 :] = -2.0
    return network


def save(
    state: Path, network: LidNetwork, optimiser: torch.optim.Optimizer, step: int, smooth: float
) -> None:
    """Write what is needed to go on, whole or not at all."""
    half = state.with_suffix(".half")
    parts = {
        "network": network.state_dict(),
        "optimiser": optimiser.state_dict(),
        "step": step,
        "smooth": smooth,
    }
    torch.save(parts, half)
    half.replace(state)


def left_out_error(network: LidNetwork, eyes: Eyes, seed: int) -> float:
    """Mean distance of points on identities left out, as part of the eye's width."""
    batch = eyes.batch(np.random.default_rng([seed, 2]), 512, left_out=True)
    pictures, points = (torch.from_numpy(part) for part in batch[:2])
    network.eval()
    with torch.no_grad():
        return float(contour_error(network(pictures), points).mean())


def main(arguments: list[str] | None = None) -> None:
    """Train, export, and write the card."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("eyes", type=Path, nargs="+")
    parser.add_argument("--steps", type=int, default=3500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    eyes = Eyes(options.eyes)
    network, run = trained(eyes, options)
    network.eval()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            network, (torch.zeros(1, 1, SIZE[1], SIZE[0]),), options.out / "lids.onnx",
            input_names=["picture"], output_names=["eye"], dynamo=False, dynamic_axes={"picture": {0: "n"}},
        )  # fmt: skip
    card = {
        "made_by": f"python -m tools.lid_network.train --steps {options.steps} --seed {options.seed}",
        "eyes": len(eyes.data["source"]),
        "identities": sorted(eyes.kept),
        "identities left out": sorted(eyes.left_out),
        "error on identities left out, share of the eye's width": left_out_error(network, eyes, options.seed),
        "parameters": sum(p.numel() for p in network.parameters()),
        "torch": torch.__version__,
        **run,
    }
    (options.out / "card.json").write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(card, indent=1))


if __name__ == "__main__":
    main()
