"""`make bench`: one bench that fails or hangs does not end the others."""

from pathlib import Path

from tools.benches import SCRIPTS, bench_commands, run_benches


def test_a_failed_and_a_hanging_bench_are_named_and_the_others_run(tmp_path: Path) -> None:
    done = tmp_path / "done"
    failed = run_benches(
        {
            "fails": ["-c", "raise TimeoutError('the server did not answer')"],
            "hangs": ["-c", "import time; time.sleep(60)"],
            "works": ["-c", f"open({str(done)!r}, 'w').close()"],
        },
        longest_s=2,
    )
    assert set(failed) == {"fails", "hangs"}
    assert done.exists()


def test_every_bench_that_is_named_is_there() -> None:
    assert {name.split()[0] for name in SCRIPTS} <= {path.stem for path in Path("tests/bench").glob("*.py")}
    assert all(
        Path(arguments[0]).is_file() for name, arguments in bench_commands().items() if name != "timings"
    )
