"""Build the playground of the blink engine: one page that opens from a folder (`make playground`)."""

import argparse
import base64
import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from experiments.files import whole_text  # noqa: E402

PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Blink engine: playground</title>
<style>{style}</style>
</head>
<body>
<h1>Natural blinks</h1>
<p>Blinks as the engine draws them, beside the uniform timer that most programs have. Everything on this
page happens on your computer.</p>
<div id="playground" class="playground"></div>
<script type="application/json" id="strips">{strips}</script>
<script>{script}</script>
</body>
</html>
"""


def page(built: Path, strips: Path) -> str:
    """The page, from `npm run build:playground` and `stimuli strips`; all of it stands in one file."""
    declared = json.loads((strips / "strips.json").read_text(encoding="utf-8"))
    declared["pictures"] = {
        name: "data:image/webp;base64," + base64.b64encode((strips / f"{name}.webp").read_bytes()).decode()
        for name in declared["characters"]
    }
    script = (built / "playground.js").read_text(encoding="utf-8")
    return PAGE.format(
        style=(built / "playground.css").read_text(encoding="utf-8"),
        # Inside a script element only "</" could end it early.
        strips=json.dumps(declared).replace("</", "<\\/"),
        script=script.replace("</script", "<\\/script"),
    )


def main() -> None:
    """Build script, pictures and page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "dist" / "playground.html", help="page to write")
    target = parser.parse_args().out
    subprocess.run(["npm", "run", "--silent", "build:playground"], cwd=ROOT / "frontend", check=True)
    with TemporaryDirectory() as folder:
        stimuli = [str(Path(sys.executable).with_name("stimuli")), "strips", "--out", folder]
        subprocess.run(stimuli, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
        text = page(ROOT / "frontend" / "dist" / "playground", Path(folder))
    target.parent.mkdir(parents=True, exist_ok=True)
    with whole_text(target) as stream:
        stream.write(text)
    sys.stdout.write(f"wrote {target} ({len(text) / 1e6:.1f} MB); open it in a browser\n")


if __name__ == "__main__":
    main()
