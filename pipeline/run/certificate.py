"""A task's result together with what computed it, so that no result has to be trusted for where it came from.

Whoever carries a task out says what program, libraries and processor it has (`pipeline.run.maker`), and
declines a task of another program before it begins. Whoever asked checks both again when the result comes:
workers may join, leave and change at any time.
"""

import hashlib
import pickle
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.run import maker


@dataclass(frozen=True)
class Certified:
    """What became of a task.

    Parameters
    ----------
    maker : mapping
        Of the process that carried it out, see `pipeline.run.maker.present_maker`.
    worker : str
        Its address.
    packed : bytes
        The pickled result, or the error that the task raised; empty if the process declined the task.
    sha256 : str
        Of ``packed``, 64 hexadecimal digits.
    is_raised : bool
        Whether it is an error.
    """

    maker: Mapping[str, Any]
    worker: str
    packed: bytes = b""
    sha256: str = ""
    is_raised: bool = False

    @property
    def is_whole(self) -> bool:
        """Whether the result is the one that was certified."""
        return hashlib.sha256(self.packed).hexdigest() == self.sha256

    def result(self) -> Any:
        """Return the result, or raise the task's error."""
        # as Dask itself does with what its workers send: whoever may join them may run code here
        result = pickle.loads(self.packed)  # noqa: S301
        if self.is_raised:
            raise result
        return result


def packed_task(function: Callable[..., Any], arguments: tuple[Any, ...]) -> bytes:
    """Return a task as bytes, which another program can decline without understanding them."""
    return pickle.dumps((function, arguments))


def carry_out(asker: Mapping[str, Any], packed: bytes, worker: str) -> Certified:
    """Carry out a packed task, unless this process differs from the one that asks.

    Parameters
    ----------
    asker : mapping
        The maker of the process that asks.
    packed : bytes
        See `packed_task`.
    worker : str
        The address of this process.
    """
    present = maker.present_maker()
    if maker.unfit(asker, present):
        return Certified(present, worker)
    function, arguments = pickle.loads(packed)  # noqa: S301 - as above
    try:
        result, is_raised = function(*arguments), False
    except Exception as error:  # noqa: BLE001 - raised again where the result is taken
        error.add_note(f"on the worker {worker}:\n{traceback.format_exc()}")
        result, is_raised = error, True
    content = pickle.dumps(result)
    return Certified(present, worker, content, hashlib.sha256(content).hexdigest(), is_raised)
