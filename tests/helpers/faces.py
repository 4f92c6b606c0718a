"""The demonstration of faces with any number of them."""

from experiments.declaration.experiment import Experiment
from experiments.load import locate, parse_experiment

DEMO = locate("faces-demo").read_text(encoding="utf-8")
HEAD, PROFILES = DEMO.split("[[factors]]")[0], DEMO.split("[[factors]]")[2]


def faces(number: int, seen: int | None, more: str = "", keys: str = "random = true") -> Experiment:
    """The demonstration with so many faces, of which a participant sees `seen`."""
    dealt = "" if seen is None else f"per_participant = {seen}\n"
    levels = "".join(
        f'[[factors.levels]]\nname = "f{k}"\nlabel = "F{k}"\nrender = {{ character = "face-{k}" }}\n\n'
        for k in range(number)
    )
    face = f'[[factors]]\nname = "face"\nlabel = "Face"\n{keys}\n{dealt}\n{levels}'
    return parse_experiment(f"{HEAD}{face}[[factors]]{PROFILES}{more}")
