"""A Slurm of one node on this machine: without systemd, on loopback only, in a folder of its own."""

import os
import re
import shutil
import socket
import subprocess
import tempfile
import time
from pathlib import Path

#: Small, so that a few cells are more than an array takes.
ARRAY_LIMIT = 6
PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "scontrol", "scancel", "sinfo")

CONFIGURATION = """\
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
CryptoType=crypto/munge
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
SlurmctldPort={controller_port}
SlurmdPort={node_port}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/backfill
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
KillWait=2
JobRequeue=1
MaxArraySize={array_limit}
SlurmctldTimeout=300
SlurmdTimeout=300
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory} State=UNKNOWN
PartitionName=debug Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def why_not():
    """Why there can be no cluster here, or None."""
    path = os.environ["PATH"] + os.pathsep + os.pathsep.join(("/usr/sbin", "/sbin"))
    missing = [name for name in PROGRAMS if shutil.which(name, path=path) is None]
    if missing:
        return f"{missing[0]} is not installed (Debian's packages slurm-wlm and munge; `make test-slurm` installs them)"
    return None if os.geteuid() == 0 else "slurmd starts jobs only as root"


class Cluster:
    """Starts munged, slurmctld and slurmd as children of this process; ``stop`` ends exactly those."""

    def __init__(self):
        self.folder = Path(tempfile.mkdtemp(prefix="slurm-", dir="/tmp"))  # short: sockets have at most 107 characters
        self.environment = {
            **{
                key: value
                for key, value in os.environ.items()
                if not key.startswith(("SLURM_", "SBATCH_", "SUBMITIT_"))
            },
            "SLURM_CONF": str(self.folder / "slurm.conf"),
            "PATH": os.environ["PATH"] + os.pathsep + "/usr/sbin" + os.pathsep + "/sbin",
        }
        self._processes = []
        self._held_since = {}

    def start(self):
        munge = self.folder / "munge"
        self.folder.chmod(0o755)
        for name in ("munge", "state", "spool"):
            (self.folder / name).mkdir(mode=0o755)
        munge.chmod(0o711)
        (munge / "key").write_bytes(os.urandom(128))
        (munge / "key").chmod(0o400)
        found = dict(re.findall(r"(\w+)=(\S+)", self._run("slurmd", "-C", configured=False)))
        (self.folder / "slurm.conf").write_text(
            CONFIGURATION.format(
                folder=self.folder,
                host=socket.gethostname().partition(".")[0],
                controller_port=free_port(),
                node_port=free_port(),
                cores=found["CPUs"],
                memory=found["RealMemory"],
                array_limit=ARRAY_LIMIT,
            )
        )
        files = {"socket": "socket", "key-file": "key", "log-file": "log", "pid-file": "pid", "seed-file": "seed"}
        self._start("munged", "--foreground", *(f"--{option}={munge / name}" for option, name in files.items()))
        wait_for(lambda: (munge / "socket").exists(), 20, "munged")
        self._start("slurmctld", "-D", "-f", self.environment["SLURM_CONF"])
        self._start("slurmd", "-D", "-f", self.environment["SLURM_CONF"])
        wait_for(lambda: self.run("sinfo", "-h", "-o", "%T").strip() == "idle", 60, "an idle node")
        return self

    def stop(self):
        try:
            if len(self._processes) == 3:
                self.cancel_all()
        finally:
            for process in reversed(self._processes):
                process.terminate()
                try:
                    process.wait(timeout=20)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
            shutil.rmtree(self.folder, ignore_errors=True)

    def run(self, *command):
        return self._run(*command)

    def cancel_all(self):
        for job in self.run("squeue", "-h", "-o", "%A").split():
            subprocess.run(["scancel", job], env=self.environment, check=False)
        wait_for(lambda: not self.run("squeue", "-h"), 60, "an empty queue")

    def jobs(self):
        """State of every job that is not over: ``{"12_0": "RUNNING"}``."""
        lines = self.run("squeue", "-h", "-r", "-o", "%i %T").splitlines()
        return dict(line.split() for line in lines)

    def job_daemons(self):
        """Sockets of the daemons that are at a job on the node."""
        return list((self.folder / "spool").glob("*_[0-9]*.*"))

    def start_requeued(self):
        """Slurm holds a requeued job for two minutes; two seconds do (in the same second its credential is revoked)."""
        for line in self.run("squeue", "-h", "-r", "-o", "%i %T %r").splitlines():
            job, state, reason = line.split(maxsplit=2)
            if state != "PENDING" or reason != "BeginTime":
                self._held_since.pop(job, None)
            elif time.monotonic() - self._held_since.setdefault(job, time.monotonic()) > 2.5:
                subprocess.run(
                    ["scontrol", "update", f"JobId={job}", "StartTime=now"], env=self.environment, capture_output=True
                )

    def _run(self, *command, configured=True):
        environment = (
            self.environment if configured else {k: v for k, v in self.environment.items() if k != "SLURM_CONF"}
        )
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
        return done.stdout

    def _start(self, *command):
        with (self.folder / f"{command[0]}.out").open("wb") as out:
            self._processes.append(
                subprocess.Popen(
                    command,
                    env=self.environment,
                    stdin=subprocess.DEVNULL,
                    stdout=out,
                    stderr=out,
                    start_new_session=True,
                )
            )


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_for(condition, seconds, what, poll=0.2):
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if condition():
            return
        time.sleep(poll)
    raise AssertionError(f"waited {seconds} s for {what}")
