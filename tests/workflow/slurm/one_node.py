"""A real SLURM of one node, with every file of it in one folder, for as long as a test takes."""

import contextlib
import importlib.util
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import psutil

DAEMONS = ("munged", "slurmctld", "slurmd")
PLUGIN = "snakemake_executor_plugin_slurm"
CORES = 2
CONFIGURATION = """
ClusterName=nbv
SlurmctldHost={host}(127.0.0.1)
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory_mb}
PartitionName=test Nodes=ALL Default=YES State=UP
SlurmUser=root
SlurmctldPort={controller_port}
SlurmdPort={node_port}
AuthType=auth/munge
# How long a job that lost its node waits before it is sent again.
AuthInfo=socket={folder}/munge/socket,cred_expire=30
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
ProctrackType=proctrack/pgid
TaskPlugin=task/none
MpiDefault=none
SlurmdParameters=config_overrides
ReturnToService=2
SlurmdTimeout=20
MinJobAge=3600
"""


def missing() -> str | None:
    """Say in one line what a test on a real SLURM lacks here; None where it lacks nothing."""
    if os.geteuid() != 0:
        return "not root: SLURM's daemons start jobs as root"
    absent = [name for name in (*DAEMONS, "squeue") if shutil.which(name) is None]
    if absent:
        return f"no {', '.join(absent)}: install Debian's slurm-wlm and munge (make test-slurm)"
    if importlib.util.find_spec(PLUGIN) is None:
        return f"no {PLUGIN}: install requirements-slurm.lock (make test-slurm)"
    return None


@dataclass
class OneNode:
    """Controller and node; jobs run on this machine, at the priority of the test."""

    folder: Path
    daemons: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    @property
    def environment(self) -> dict[str, str]:
        """Return what the commands of SLURM need to find this one and no other."""
        path = f"{self.folder / 'bin'}:{os.environ['PATH']}"
        return os.environ | {"SLURM_CONF": str(self.folder / "slurm.conf"), "PATH": path}

    def start(self, name: str, *arguments: str) -> None:
        with (self.folder / f"{name}.log").open("ab") as log:
            command = [str(shutil.which(name)), *arguments]
            self.daemons[name] = subprocess.Popen(
                command, stdout=log, stderr=log, env=self.environment, start_new_session=True
            )

    def start_munged(self) -> None:
        folder = self.folder / "munge"
        folder.mkdir(mode=0o755)
        key = folder / "key"
        key.touch(mode=0o600)
        key.write_bytes(os.urandom(1024))
        names = {"socket": "socket", "key-file": "key", "pid-file": "pid", "seed-file": "seed"}
        files = [f"--{option}={folder / name}" for option, name in names.items()]
        # It runs as root in a folder of pytest's, which it would refuse.
        self.start("munged", "--foreground", "--force", f"--log-file={folder / 'log'}", *files)
        until(lambda: (folder / "socket").exists(), "munged opens its socket")

    def start_slurmd(self) -> None:
        self.start("slurmd", "-D")

    def restart_slurmd(self) -> None:
        """Restart the node's daemon, as a system's upgrade does; its jobs run on."""
        self.stop("slurmd")
        self.start_slurmd()

    def crash(self) -> None:
        """End the node's daemon and all its jobs at once, as when power fails, and start it."""
        self.daemons["slurmd"].kill()
        self.kill_jobs()
        self.daemons["slurmd"].wait()
        self.start_slurmd()

    def kill_jobs(self) -> None:
        """End every process of every job; first SLURM's own, which would report the others' end."""
        jobs = self.processes()
        keepers = [each for job in jobs for each in job.parents() if each.name() == "slurmstepd"]
        for process in (*keepers, *jobs):
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
        # A process may be seen for a while after its kill: no one may take it for a live job.
        psutil.wait_procs([*keepers, *jobs], timeout=60)

    def processes(self) -> list[psutil.Process]:
        """Return the processes of all jobs that run."""
        found = []
        for process in psutil.process_iter():
            with contextlib.suppress(psutil.Error):
                variables = process.environ()
                mine = variables.get("SLURM_CONF") == self.environment["SLURM_CONF"]
                if mine and "SLURM_JOB_ID" in variables:
                    found.append(process)
        return found

    def in_script(self, script: str) -> list[int]:
        """Return the jobs that have come to a script of the workflow."""
        found = []
        for process in self.processes():
            with contextlib.suppress(psutil.Error):
                if any(script in Path(word).name for word in process.cmdline()[1:2]):
                    found.append(int(process.environ()["SLURM_JOB_ID"]))
        return found

    def jobs(self) -> dict[int, tuple[str, str]]:
        """Return state and comment (Snakemake's name) of every job so far."""
        rows = (line.split("|") for line in self.ask("squeue", "--states=all", "--format=%i|%T|%k"))
        return {int(number): (state, comment) for number, state, comment in rows}

    def restarts(self, job: int) -> int:
        """Return how often SLURM itself has started a job again."""
        (shown,) = self.ask("squeue", "--states=all", f"--jobs={job}", "--Format=RestartCnt")
        return int(shown)

    def is_up(self) -> bool:
        """Return whether the controller answers, and the node answers the controller."""
        try:
            (state,) = self.ask("sinfo", "--format=%T")
        except subprocess.CalledProcessError:
            return False
        return state in ("idle", "mixed", "allocated")

    def ask(self, *command: str) -> list[str]:
        """Return the lines that a command of SLURM prints, without their heading."""
        done = subprocess.run(
            [*command, "--noheader"],
            env=self.environment,
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.splitlines()

    def cancel(self, job: int) -> None:
        subprocess.run(["scancel", str(job)], env=self.environment, check=True)

    def stop(self, name: str) -> None:
        daemon = self.daemons.pop(name)
        daemon.terminate()
        try:
            daemon.wait(timeout=30)
        except subprocess.TimeoutExpired:
            daemon.kill()
            daemon.wait()


def until(is_so: Callable[[], bool], what: str, timeout_s: float = 600) -> None:
    """Wait until something is so."""
    deadline = time.monotonic() + timeout_s
    while not is_so():
        assert time.monotonic() < deadline, f"not within {timeout_s:.0f} s: {what}"
        time.sleep(0.5)


def _free_port() -> int:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        return int(server.getsockname()[1])


@contextlib.contextmanager
def one_node(folder: Path) -> Iterator[OneNode]:
    """Start munged, slurmctld and slurmd in a folder, and end them with all their jobs."""
    for name in ("state", "spool", "bin"):
        (folder / name).mkdir(parents=True)
    (folder / "slurm.conf").write_text(
        CONFIGURATION.format(
            folder=folder,
            host=socket.gethostname().split(".")[0],
            cores=CORES,
            memory_mb=psutil.virtual_memory().total * 9 // 10 // 2**20,
            controller_port=_free_port(),
            node_port=_free_port(),
        )
    )
    # The plugin starts srun without SLURM_CONF, because srun finds that of a cluster by itself.
    srun = folder / "bin/srun"
    command = f'SLURM_CONF={folder / "slurm.conf"} exec {shutil.which("srun")} "$@"'
    srun.write_text(f"#!/bin/sh\n{command}\n")
    srun.chmod(0o755)
    cluster = OneNode(folder)
    try:
        cluster.start_munged()
        cluster.start("slurmctld", "-D", "-i")
        cluster.start_slurmd()
        until(cluster.is_up, f"the node is up (logs: {folder})", timeout_s=120)
        yield cluster
    finally:
        cluster.kill_jobs()
        for name in reversed(list(cluster.daemons)):
            cluster.stop(name)
