"""Which worker renders which job."""

from random import Random

from hypothesis import given
from hypothesis import strategies as st

from stimuli_builder.clips.jobs import WORTH_READING, JobQueues


def drained(queues: JobQueues, turns: list[int]) -> dict[int, list[int]]:
    """By worker the jobs that it was given, workers asking in the order of `turns` until nobody gets one."""
    taken: dict[int, list[int]] = {worker: [] for worker in turns}
    idle: set[int] = set()
    while idle != set(turns):
        for worker in turns:
            job = queues.take(worker)
            if job is None:
                idle.add(worker)
            else:
                taken[worker].append(job)
    return taken


def test_each_of_two_workers_reads_one_of_two_characters() -> None:
    levels = ["alder"] * 40 + ["cartoon"] * 40
    taken = drained(JobQueues(range(80), levels, 2), [0, 1])
    assert taken == {0: list(range(40)), 1: list(range(40, 80))}


def test_a_worker_helps_another_with_the_character_it_has_read() -> None:
    taken = drained(JobQueues(range(12), ["alder"] * 12, 2), [0, 0, 0, 1])
    assert taken[0] == [0, 1, 2, 3, 4, 5, 11, 10, 9]
    assert taken[1] == [6, 7, 8]


def test_a_few_jobs_of_another_character_are_left_to_the_process_that_has_read_it() -> None:
    few = ["alder"] * 4 + ["cartoon"] * 4
    queues = JobQueues(range(8), few, 2)
    assert [queues.take(0) for _ in range(5)] == [0, 1, 2, 3, None]
    assert [queues.take(1) for _ in range(5)] == [4, 5, 6, 7, None]
    many = ["alder"] * (WORTH_READING + 1) + ["cartoon"] * (WORTH_READING + 1)
    queues = JobQueues(range(len(many)), many, 2)
    for _ in range(WORTH_READING + 1):
        queues.take(0)
    # Once the cartoon is read, the rest of it is shared to the last.
    assert [queues.take(0) for _ in range(3)] == [65, 64, 63]


@given(st.lists(st.integers(1, 60), min_size=1, max_size=4), st.integers(1, 6), st.randoms())
def test_every_job_is_rendered_once(runs: list[int], workers: int, random: Random) -> None:
    levels = [kind for kind, count in enumerate(runs) for _ in range(count)]
    workers = min(workers, len(levels))
    turns = [random.randrange(workers) for _ in range(5)] + list(range(workers))
    taken = drained(JobQueues(range(len(levels)), levels, workers), turns)
    assert sorted(job for jobs in taken.values() for job in jobs) == list(range(len(levels)))
