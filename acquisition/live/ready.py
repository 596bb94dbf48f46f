"""Which of many descriptors have something to read."""

from __future__ import annotations

import os
import select
import selectors
from typing import Generic, TypeVar

__all__ = ["Ready"]

T = TypeVar("T")


class Ready(Generic[T]):
    """Descriptors that are waited on, each with what it stands for.

    Notes
    -----
    It is a ``selectors.DefaultSelector``. Where that rests on epoll, the waiting asks epoll itself: what ``selectors``
    makes of each event, for readers and writers alike, costs a third of the waiting, and here all descriptors are
    read.
    """

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()
        self._values: dict[int, T] = {}
        self._epoll = None
        if hasattr(select, "epoll") and isinstance(self._selector, selectors.EpollSelector):
            self._epoll = select.epoll.fromfd(os.dup(self._selector.fileno()))

    def close(self) -> None:
        """Wait no more; the descriptors waited on stay open."""
        self._selector.close()
        if self._epoll is not None:
            self._epoll.close()

    def add(self, descriptor: int, value: T) -> None:
        """Wait on a descriptor, too."""
        self._selector.register(descriptor, selectors.EVENT_READ)
        self._values[descriptor] = value

    def remove(self, descriptor: int) -> None:
        """Wait on it no more; it must still be open."""
        self._selector.unregister(descriptor)
        del self._values[descriptor]

    def wait(self, timeout_s: float | None) -> list[tuple[int, T]]:
        """Return the descriptors that have something or have come to their end, each with its value.

        Parameters
        ----------
        timeout_s : float or None
            How long to wait for the first, s; None: without end.
        """
        values = self._values
        if self._epoll is None:
            return [(key.fd, values[key.fd]) for key, _ in self._selector.select(timeout_s)]
        return [(descriptor, values[descriptor]) for descriptor, _ in self._epoll.poll(timeout_s, len(values) or 1)]
