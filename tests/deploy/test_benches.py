"""`make bench`: one bench that fails or hangs does not end the others."""

from pathlib import Path

from bench.__main__ import SCRIPTS, bench_commands, run_benches


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
    for name in SCRIPTS:
        module, *parts = name.split()
        source = Path("bench", f"{module}.py").read_text(encoding="utf-8")
        assert "if __name__" in source, name
        # `run_part` reads the first word after a bench that has parts.
        assert "run_part(PARTS)" not in source or f'"{parts[0]}": ' in source, name
    assert all(arguments[0] == "-m" for arguments in bench_commands().values())
