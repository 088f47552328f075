"""Run computations in a background thread, so that ticks do not have to wait for results."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def run_in_background(
    wake: Callable[[], None], work: Callable[P, T], *args: P.args, **kwargs: P.kwargs
) -> Future[T]:
    """Call a function in a new thread, and return the future of the result.

    Args:
        wake: Requests a tick; called when the function has returned or raised.
        work: The function.
        *args: Positional arguments of the function.
        **kwargs: Keyword arguments of the function.
    """
    worker = ThreadPoolExecutor(1, "beside the ticks")
    future = worker.submit(work, *args, **kwargs)
    worker.shutdown(wait=False)
    future.add_done_callback(lambda _: wake())
    return future
