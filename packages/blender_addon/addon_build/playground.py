"""Build the pages of the blink engine that open from a folder: the playground and the VRM avatar."""

import argparse
import base64
import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments.files import whole_text

ROOT = Path(__file__).resolve().parents[3]
BUILT = ROOT / "frontend" / "dist"
PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<h1>{title}</h1>
{body}
<script>{script}</script>
</body>
</html>
"""
PLAYGROUND = """<p>Blinks as the engine draws them, next to the uniform timer that most programs have.
Everything on this page happens on your computer.</p>
<div id="playground" class="playground"></div>
<script type="application/json" id="strips">{strips}</script>"""
VRM = """<canvas width="640" height="480" role="img" aria-label="An avatar that blinks"></canvas>
<p id="said" role="status"></p>
<p><label>Your avatar: <input type="file" accept=".vrm"></label></p>
<p>The model stays on your computer.</p>"""


def playground_page(strips: Path) -> str:
    """The playground, with the pictures that `stimuli strips` wrote to a folder."""
    declared = json.loads((strips / "strips.json").read_text(encoding="utf-8"))
    declared["pictures"] = {
        name: "data:image/webp;base64," + base64.b64encode((strips / f"{name}.webp").read_bytes()).decode()
        for name in declared["characters"]
    }
    # Inside a script element only "</" could end it early.
    return _page(
        "playground", "Natural blinks", PLAYGROUND.format(strips=json.dumps(declared).replace("</", "<\\/"))
    )


def vrm_page() -> str:
    """A VRM avatar in three.js that blinks by the engine."""
    return _page("vrm", "An avatar that blinks", VRM)


def build_scripts() -> None:
    """Bundle the scripts of both pages."""
    subprocess.run(["npm", "run", "--silent", "build:playground"], cwd=ROOT / "frontend", check=True)


def _page(name: str, title: str, body: str) -> str:
    script, style = (
        (BUILT / name / f"{name}.{suffix}").read_text(encoding="utf-8") for suffix in ("js", "css")
    )
    return PAGE.format(title=title, style=style, body=body, script=script.replace("</script", "<\\/script"))


def main() -> None:
    """Build scripts, pictures and pages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder to write to (dist)")
    folder = parser.parse_args().out
    build_scripts()
    with TemporaryDirectory() as strips:
        stimuli = [str(Path(sys.executable).with_name("stimuli")), "strips", "--out", strips]
        subprocess.run(stimuli, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
        pages = {"playground.html": playground_page(Path(strips)), "vrm.html": vrm_page()}
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages.items():
        with whole_text(folder / name) as stream:
            stream.write(text)
        sys.stdout.write(f"wrote {folder / name} ({len(text) / 1e6:.1f} MB); open it in a browser\n")


if __name__ == "__main__":
    main()
