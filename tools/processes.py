"""Work in processes of its own, for benchmarks and hunts."""

import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import active_children, get_context
from typing import TypeVar

Task, Result = TypeVar("Task"), TypeVar("Result")


def results_as_done(
    work: Callable[[Task], Result], tasks: Sequence[Task], jobs: int
) -> Iterator[tuple[int, Result]]:
    """Index of each task and its result, in the order in which they are done.

    The processes end at once where a task fails, the command is stopped, or the caller leaves
    its loop.

    Args:
        work: Function of a task, at the top level of a module.
        tasks: Tasks, at least one.
        jobs: Largest number of processes.

    """
    with ProcessPoolExecutor(
        min(jobs, len(tasks)),
        mp_context=get_context("spawn"),
        # Ctrl-C ends the workers without a word of their own.
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_DFL),
    ) as pool:
        try:
            waiting = {pool.submit(work, task): number for number, task in enumerate(tasks)}
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        except BaseException:
            # Leaving the pool would wait for the tasks in hand. Ctrl-C in the caller's loop
            # reaches this generator as GeneratorExit.
            end_processes()
            raise


def end_processes() -> None:
    """The end of all processes begun here, at once."""
    for process in active_children():
        process.terminate()
