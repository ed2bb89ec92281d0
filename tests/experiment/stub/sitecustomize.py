"""Put on PYTHONPATH by tests: a trainer that only pretends, in every process that they start.

``STUB`` is JSON: what a run does by its seed ("raise", "exit", "kill", "hang", "hang in native code", "enospc",
"diverge"), "gate", the folder of a gate at which every run waits at step 500 and later (see tests/gate), and
"importing", seconds before a job can take a signal; "recording", seconds that recording an interruption takes;
"without", functions of the C library that are taken away. torch can't be imported: neither the parent nor the rim
needs it.
"""

import ctypes
import errno
import json
import os
import pathlib
import signal
import sys
import time
import types
from pathlib import Path


class NoTorch:
    def find_spec(self, name, path=None, target=None):
        if name == "torch" or name.startswith("torch."):
            raise ImportError("this test forbids torch")
        return None


def train(config, run, progress, stop_requested):
    from src.experiment.state import Outcome

    plan = json.loads(os.environ["STUB"])
    checkpoint = run.state / "checkpoint"
    step = int(checkpoint.read_text()) if checkpoint.exists() else 0
    with (run.state / "calls").open("a") as calls:
        calls.write(f"{os.getpid()} from {step}\n")
    run.cut_after(step)
    if step == 0:
        run.evaluations.append(0, [(0.5, 7)])
    run.update_manifest(observation_size=11, action_size=3, parameters={"actor": 1, "critic": 2})
    total = config.protocol.total_steps
    while step < total:
        if "gate" in plan and step >= 500:
            from tests.gate import wait_at_gate

            wait_at_gate(Path(plan["gate"]), config.seed, stop_requested)
        behaviour = plan.get(str(config.seed)) if step == 500 else None
        if behaviour == "raise":
            raise RuntimeError("boom\nsecond line")
        if behaviour == "exit":
            sys.exit(3)
        if behaviour == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if behaviour == "hang":
            signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
            (run.state / "hanging").touch()
            for _ in range(6000):
                time.sleep(0.1)
                if stop_requested():
                    (run.state / "asked to stop").touch()
        if behaviour == "hang in native code":
            ctypes.PyDLL(None).sleep(600)  # keeps the interpreter's lock: no Python handler ever runs
        if behaviour == "enospc":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "replay.bin")
        if behaviour == "diverge":
            return Outcome("diverged", step, f"critic_loss is not finite at step {step}")
        step += 500
        run.evaluations.append(step, [(float(step) / 3, 7), (1.0, 8)])
        run.training.write({"step": step, "critic_loss": None, "steps_per_second": 100.0})
        checkpoint.write_text(str(step))
        (run.state / "checkpoint-1.pt").touch()
        (run.state / "replay.bin").touch()
        progress.update(step, float(step) / 3, 100.0)
        if stop_requested() and step < total:
            if "recording" in plan:
                record_slowly(run, plan["recording"])
            return Outcome("interrupted", step, f"checkpoint written at step {step}")
    return Outcome("complete", step, "")


def record_slowly(run, seconds):
    """How the run ended is recorded only after a while, whose beginning ``state/recording`` shows."""
    update = run.update_manifest

    def slow(**changes):
        (run.state / "recording").touch()
        time.sleep(seconds)
        update(**changes)

    run.update_manifest = slow


if "STUB" in os.environ:
    sys.meta_path.insert(0, NoTorch())
    package, session = types.ModuleType("src.training"), types.ModuleType("src.training.session")
    package.__path__ = [str(pathlib.Path(__file__).parents[3] / "src" / "training")]  # the plan builds tasks
    package.session = session
    session.train = train
    sys.modules |= {"src.training": package, "src.training.session": session}
    for name in json.loads(os.environ["STUB"]).get("without", ()):
        setattr(ctypes.CDLL, name, property(lambda _: (_ for _ in ()).throw(AttributeError("not on this machine"))))
    if "src.experiment.worker" in sys.orig_argv:
        time.sleep(json.loads(os.environ["STUB"]).get("importing", 0))
