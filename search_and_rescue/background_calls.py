"""Background computation, so that ticks do not wait."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def run_in_background(
    wake: Callable[[], None], work: Callable[P, T], *args: P.args, **kwargs: P.kwargs
) -> Future[T]:
    """Start work in a new thread.

    Args:
        wake: Requests a tick; called when the work has ended.
        work: The work.
        *args: Its arguments.
        **kwargs: Its keyword arguments.
    """
    worker = ThreadPoolExecutor(1, "beside the ticks")
    future = worker.submit(work, *args, **kwargs)
    worker.shutdown(wait=False)
    future.add_done_callback(lambda _: wake())
    return future
