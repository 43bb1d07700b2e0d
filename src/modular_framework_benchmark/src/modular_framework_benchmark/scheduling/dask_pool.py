# SPDX-License-Identifier: BSD-3-Clause
"""Worker pool on a Dask cluster: each episode is a task, and only this process writes results.

A task runs its episode in a separate process beside the Dask worker, like a local run. ROS nodes need a main thread,
and resources that an episode leaves open end with its process.
"""

from __future__ import annotations

import dataclasses
import threading
import time
import uuid
from pathlib import Path
from typing import Any

import distributed
from distributed.worker import thread_state  # type: ignore[attr-defined]

from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec, EpisodeStatus
from modular_framework_benchmark.scheduling.episode_runner import RunnerFactory, unrun_record
from modular_framework_benchmark.scheduling.local_pool import LocalPool, SchedulerError
from modular_framework_benchmark.scheduling.worker_process import WorkerStartError

POLL_S = 0.25
"""Period of a task's check whether it was released [s]."""
CONNECT_TIMEOUT_S = 20.0
NO_WORKER_TIMEOUT_S = 120.0


class DaskPool:
    """Workers of a Dask cluster; implements `Pool`. Each thread of a Dask worker is a slot.

    Args:
        address: Address of the scheduler, such as tcp://127.0.0.1:8786.
        make_runner: Factory of the runners, from a module that the workers can import.
        run: Mark of the run, see `marked_processes`.
        logs: Folder of the log files, on a file system that all workers share.
    """

    def __init__(self, address: str, make_runner: RunnerFactory, run: str, logs: Path) -> None:
        self._make_runner, self._run, self._logs = make_runner, run, logs
        try:
            self._client: Any = distributed.Client(address, timeout=CONNECT_TIMEOUT_S)  # type: ignore[no-untyped-call]
            self._client.wait_for_workers(1, timeout=NO_WORKER_TIMEOUT_S)
        except (OSError, ValueError, TimeoutError) as error:
            raise SchedulerError(
                f"no Dask scheduler with workers answers at {address} ({error}); start one with 'dask scheduler' and "
                "'dask worker ADDRESS --nthreads 1', or correct the address"
            ) from error
        self._futures: dict[Any, tuple[str, EpisodeSpec, float]] = {}

    def free_slots(self) -> list[str]:
        """Returns the slots without a task as WORKER_ADDRESS#NUMBER."""
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        slots = [f"{address}#{number}" for address, info in workers.items() for number in range(info["nthreads"])]
        taken_slots = {slot for slot, _, _ in self._futures.values()}
        free = [slot for slot in slots if slot not in taken_slots]
        return free[: max(0, len(slots) - len(self._futures))]

    def submit(self, slot: str, spec: EpisodeSpec, folder: Path) -> None:
        """Submits an episode to the worker of a slot, or to another worker if it is lost.

        Args:
            slot: Free slot.
            spec: Specification of the episode.
            folder: Folder of the episode's files.
        """
        future = self._client.submit(
            run_task, self._make_runner, self._run, self._logs, spec, folder,
            key=f"episode-{spec.number}-{uuid.uuid4().hex}",
            workers=[slot.partition("#")[0]], allow_other_workers=True, pure=False,
        )  # fmt: skip
        self._futures[future] = slot, spec, time.time()

    def wait(self, timeout_s: float) -> list[EpisodeRecord]:
        """Returns the records of ended episodes.

        Raises:
            WorkerStartError: A worker cannot run episodes of this experiment.
        """
        if not self._futures:
            return []
        try:
            futures: Any = list(self._futures)
            distributed.wait(futures, timeout=timeout_s, return_when="FIRST_COMPLETED")  # type: ignore[no-untyped-call]
        except TimeoutError:
            return []
        return [self._result(future) for future in list(self._futures) if future.done()]

    def _result(self, future: Any) -> EpisodeRecord:
        _, spec, begun = self._futures.pop(future)
        try:
            record: EpisodeRecord = future.result(timeout=30)
            return record
        except WorkerStartError:
            raise
        except Exception as error:  # a lost worker, or an error of the task
            cause = f"its Dask task failed: {type(error).__name__}: {error}"
            return unrun_record(spec, EpisodeStatus.BROKEN, cause, begun=begun, wall_s=time.time() - begun)

    def close(self) -> None:
        """Ends the workers' processes and disconnects from the scheduler."""
        if self._client.status == "running":
            self._client.run(close_runners, self._run)
        self._client.close()

    def kill(self) -> None:
        """Releases the tasks, which abort their episodes; the Dask workers stay available."""
        for future in self._futures:
            future.release()
        self._futures.clear()
        self._client.close()


_pools: dict[tuple[str, int], LocalPool] = {}
"""Process of each thread in a Dask worker, kept between episodes, keyed by run and thread."""


def run_task(make_runner: RunnerFactory, run: str, logs: Path, spec: EpisodeSpec, folder: Path) -> EpisodeRecord:
    """Runs an episode in a Dask worker until it ends or is released.

    Args:
        make_runner: Factory of the runners.
        run: Mark of the run, see `marked_processes`.
        logs: Folder of the log files.
        spec: Specification of the episode.
        folder: Folder of the episode's files.
    """
    worker = distributed.get_worker()
    key = thread_state.key
    name = f"{worker.name}".replace("/", "_").replace(":", "_")
    identity = (run, threading.get_ident())
    pool = _pools.get(identity)
    if pool is None:
        prefix = f"dask_{name}_{len(_pools)}_"
        pool = _pools[identity] = LocalPool(make_runner, 1, run, logs, prefix)
    try:
        pool.submit(pool.free_slots()[0], spec, folder)
        while _is_wanted(worker, key):
            records = pool.wait(POLL_S)
            if records:
                return dataclasses.replace(records[0], worker=f"{records[0].worker} at {worker.address}")
    except BaseException:
        pool.kill()
        raise
    pool.kill()
    raise InterruptedError("the run of this episode has ended")


def _is_wanted(worker: Any, key: str) -> bool:
    task = worker.state.tasks.get(key)
    return task is not None and task.state == "executing"


def close_runners(run: str) -> None:
    """Ends the idle processes of a run in a Dask worker."""
    for identity in [key for key in _pools if key[0] == run]:
        _pools.pop(identity).close()
