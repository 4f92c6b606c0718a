"""Fail where a tracked file names a registry's host or a machine's path, or a lock file lacks hashes."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HOSTS = re.compile(
    r"https?://[^\s\"']*(/simple/|/packages/[0-9a-f]{2}/|/-/[^\s\"']*\.tgz)|registry\.npmjs|files\.pythonhosted"
)
MACHINE = re.compile(r"(?:^|[\s\"'=(:])/(?:work|farm|root)/[a-z.]")
BINARY = {".png", ".webp", ".jpg", ".mp4", ".npz", ".woff2", ".ico"}
FORBIDDEN = {"uv.lock", "pylock.toml"}


def main() -> int:
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    problems = []
    for name in filter(None, listed.split("\0")):
        path = ROOT / name
        if path.name in FORBIDDEN:
            problems.append(f"{name}: records registry hosts; remove it")
        if path.suffix in BINARY or not path.is_file() or path == Path(__file__):
            continue
        for number, line in enumerate(
            path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1
        ):
            if HOSTS.search(line) or MACHINE.search(line):
                problems.append(
                    f"{name}:{number}: names a registry's host or a machine's path: {line.strip()[:90]}"
                )
    for lock in ("requirements.lock", "requirements-docs.lock", "requirements-dev.lock", "deploy/s3.lock"):
        if "--hash=sha256:" not in (ROOT / lock).read_text():
            problems.append(f"{lock}: has no hashes; run `make lock`")
    print("\n".join(problems) if problems else "lock files and host names: clean")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
