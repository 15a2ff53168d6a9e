"""The inside of a worker process: reads problems from standard input, writes answers to what was standard output.

Problems arrive pickled, answers leave as one line of JSON each. What a solver's library prints goes nowhere. The
process ends when its standard input is closed, that is, at the latest with its parent. Read `worker_solver` next.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import math
import os
import pickle
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import IO, Any, TypeGuard, cast

from scenicq.processes import limit_memory
from scenicq.refusals import refused_by_system
from scenicq.smt.answer import Answer, NoAnswer, Sat, Unsat
from scenicq.smt.problem import Problem

__all__ = ["Check", "Request", "Setup", "read_answer", "seconds_of", "serve", "write_answer"]

Check = Callable[..., Answer]
"""A function like `Solver.check`."""
_TOOK = "took_s"
"""The key of an answer's processor seconds."""


@dataclass(frozen=True, slots=True)
class Setup:
    """The first message to a worker.

    Attributes:
        kind: `module:function` of the check.
        memory_mb: Limit of the address space, if any.
    """

    kind: str
    memory_mb: int | None


@dataclass(frozen=True, slots=True)
class Request:
    """A problem to be decided.

    Attributes:
        problem: The problem.
        precision: See `Solver.check`.
        timeout_s: See `Solver.check`.
        deadline_s: Seconds of the processor after which the process ends itself.
    """

    problem: Problem
    precision: float
    timeout_s: float
    deadline_s: float


def serve(setup: Setup, requests: IO[bytes], descriptor: int) -> None:
    """Answer requests until there are no more; never returns.

    Args:
        setup: What to run.
        requests: The stream that the setup came from.
        descriptor: The file descriptor for answers. Standard output and standard error lead nowhere.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(descriptor, "wb")
    check = _load(setup, answers)
    inbox: queue.SimpleQueue[Request] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(requests, inbox), daemon=True).start()
    while True:
        request = inbox.get()
        began = time.process_time()
        _set_alarm(request.deadline_s)
        answer = _answer(check, request)
        _set_alarm(0.0)
        _send(answers, {**write_answer(answer), _TOOK: time.process_time() - began})


def _load(setup: Setup, answers: IO[bytes]) -> Check:
    module, _, name = setup.kind.partition(":")
    try:
        check: Check = getattr(importlib.import_module(module), name)
        if setup.memory_mb is not None:
            limit_memory(setup.memory_mb * 2**20)
            # absent on Windows
            resource = importlib.import_module("resource")
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except Exception as error:  # noqa: BLE001 - whatever a library raises when it is loaded is the reason to report
        refused = refused_by_system(error)
        _send(answers, {"refused": refused} if refused else {"failed": f"{type(error).__name__}: {error}"})
        os._exit(1)
    _send(answers, {"ready": str(getattr(sys.modules[module], "VERSION", ""))})
    return check


def _receive(requests: IO[bytes], inbox: queue.SimpleQueue[Request]) -> None:
    """Hand requests on; the end of the stream ends the process, whatever it is computing."""
    with contextlib.suppress(EOFError, OSError, pickle.UnpicklingError):
        while True:
            inbox.put(pickle.load(requests))  # noqa: S301 - the parent wrote it
    os._exit(0)


def _set_alarm(seconds: float) -> None:
    """End the process by signal after so much work; a library that holds the interpreter cannot prevent it."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, seconds)


def _answer(check: Check, request: Request) -> Answer:
    try:
        return check(request.problem, precision=request.precision, timeout_s=request.timeout_s)
    except MemoryError:
        return NoAnswer("memory")
    except Exception:  # noqa: BLE001 - a failing solver is an answer
        return NoAnswer("crash")


def _send(answers: IO[bytes], message: object) -> None:
    try:
        answers.write(json.dumps(message).encode() + b"\n")
        answers.flush()
    except OSError:
        # the parent is gone
        os._exit(0)


def write_answer(answer: Answer) -> dict[str, object]:
    """An answer as JSON."""
    match answer:
        case Sat(witness):
            return {"sat": {name: float(value) for name, value in witness.items()}}
        case Unsat():
            return {"unsat": True}
        case NoAnswer(reason):
            return {"unknown": reason}


def read_answer(line: bytes) -> Answer:
    """The answer that a line holds; `NoAnswer("garbage")` if it holds none."""
    try:
        message: dict[str, Any] = json.loads(line)
    except ValueError:
        return NoAnswer("garbage")
    match message:
        case {"sat": witness} if _is_witness(witness):
            return Sat(witness)
        case {"unsat": True}:
            return Unsat()
        case {"unknown": str() as reason}:
            return NoAnswer(reason)
        case _:
            return NoAnswer("garbage")


def seconds_of(line: bytes) -> float | None:
    """The processor seconds that an answer took; None if the line does not say."""
    try:
        message: object = json.loads(line)
    except ValueError:
        return None
    took = cast("dict[str, object]", message).get(_TOOK) if isinstance(message, dict) else None
    return took if isinstance(took, float) and took >= 0 else None


def _is_witness(value: Any) -> TypeGuard[dict[str, float]]:
    return isinstance(value, dict) and all(
        isinstance(number, float) and math.isfinite(number) for number in cast(dict[str, object], value).values()
    )
