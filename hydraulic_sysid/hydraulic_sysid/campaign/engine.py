"""The loop of a campaign: hands cases out, takes outcomes in, survives dying workers and its own death."""

from __future__ import annotations

import fcntl
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hydraulic_sysid.campaign.executors import Crew
from hydraulic_sysid.campaign.manifest import CampaignError
from hydraulic_sysid.campaign.outcome import CASES, FAILED, Case, Outcome, attempt, file_of, keep, kept

_DEATHS = 2  # of a worker with one case alone, after which that has failed
Work = Callable[[Any, Path], Mapping[str, Any]]


@dataclass
class Progress:
    """How far a campaign is: cases in all, found done at the start, done since, failed; seconds since the start."""

    total: int
    before: int = 0
    now: int = 0
    failed: int = 0
    begun: float = field(default_factory=time.monotonic)
    last: Outcome | None = None

    @property
    def rate(self) -> float:
        """Cases per second since the start."""
        return self.now / max(time.monotonic() - self.begun, 1e-9)

    @property
    def seconds_left(self) -> float | None:
        """Time that the cases left take at this rate; None before the first."""
        return (self.total - self.before - self.now) / self.rate if self.now else None


def run(
    work: Work,
    cases: Sequence[Case],
    folder: Path,
    crew: Crew,
    told: Callable[[Progress], None] = lambda _: None,
    again: bool = False,
) -> list[Outcome]:
    """Do the work on every case whose outcome is not yet in ``folder``; the outcomes of all, in their order.

    :param work: ``work(argument, place)``, a function of a module: row of figures; see `outcome.attempt`
    :param again: do it again where the outcome that is kept is a failure
    :raises CampaignError: another campaign is under way in the folder, or two different cases have one key.
    """
    (folder / CASES).mkdir(parents=True, exist_ok=True)
    with _alone_in(folder):
        by_key = {case.key: case for case in cases}
        outcomes = {key: found for key, case in by_key.items() if (found := kept(folder, case)) is not None}
        if again:
            for key in [key for key, found in outcomes.items() if found.failed]:
                file_of(folder, key).unlink()
                del outcomes[key]
        progress = Progress(len(by_key), len(outcomes), failed=sum(o.failed for o in outcomes.values()))
        told(progress)
        todo = [case for key, case in by_key.items() if key not in outcomes]
        for outcome in _worked(work, todo, folder, crew) if todo else ():
            outcomes[outcome.key] = outcome
            progress.now += 1
            progress.failed += outcome.failed
            progress.last = outcome
            told(progress)
        return [_labelled(outcomes[case.key], case) for case in cases]


def _labelled(outcome: Outcome, case: Case) -> Outcome:
    return Outcome(**{**vars(outcome), "labels": dict(case.labels)})


def _worked(work: Work, todo: Sequence[Case], folder: Path, crew: Crew) -> Iterator[Outcome]:
    """Outcomes as they come. Cases with which a worker dies are tried alone; one that it dies with twice has failed."""
    waiting, suspects, deaths = deque(todo), deque[Case](), Counter[str]()
    flying: dict[Future, Case] = {}
    executor: Executor | None = None
    alone: Case | None = None
    try:
        while waiting or suspects or flying:
            executor = executor or crew.start()
            broken: list[Case] = []
            try:
                if suspects and not flying:
                    alone = suspects.popleft()
                    flying[executor.submit(attempt, work, alone, folder)] = alone
                while waiting and not suspects and alone is None and len(flying) < crew.width:
                    flying[executor.submit(attempt, work, waiting[0], folder)] = waiting[0]
                    waiting.popleft()
            except BrokenExecutor:
                if not flying:  # else those under way say so below
                    if alone is not None:
                        suspects.appendleft(alone)
                    crew.rid(executor)
                    alone, executor = None, None
                    continue
            for future in wait(flying, return_when=FIRST_COMPLETED).done:
                case = flying.pop(future)
                try:
                    outcome = future.result()
                except BrokenExecutor:
                    broken.append(case)
                    continue
                except Exception as error:  # of the cluster itself: a worker that died again and again, say
                    outcome = _failed(case, f"{type(error).__name__}: {error}")
                if not file_of(folder, case.key).exists():  # worked where this folder is not
                    keep(folder, outcome)
                alone = None
                yield outcome
            if broken:
                crew.rid(executor)
                executor = None
                lost = [*broken, *flying.values()]
                flying.clear()
                if alone is not None:
                    deaths[alone.key] += 1
                    if deaths[alone.key] == _DEATHS:
                        outcome = _failed(alone, f"its worker died {_DEATHS} times (out of memory, or killed)")
                        keep(folder, outcome)
                        lost = []
                        yield outcome
                    alone = None
                for case in lost:  # some may have ended just before
                    outcome_kept = kept(folder, case)
                    if outcome_kept is None:
                        suspects.append(case)
                    else:
                        yield outcome_kept
        if executor is not None:
            executor.shutdown()
    finally:
        if executor is not None:
            crew.rid(executor)


def _failed(case: Case, error: str) -> Outcome:
    return Outcome(case.key, case.labels, FAILED, error=error)


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Holds the folder; the lock ends with the process, however that ends."""
    with (folder / ".campaign.lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise CampaignError(f"{folder}: another campaign is under way there") from None
        yield
