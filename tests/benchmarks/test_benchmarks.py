"""The benchmarks run and measure what they say. No test here looks at a time."""

from __future__ import annotations

import json
import math
import mmap
import os
import threading
from collections.abc import Callable, Iterator
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import psutil
import pytest
import torch
from threadpoolctl import threadpool_info, threadpool_limits

from benchmarks import __main__ as command
from benchmarks import floor, gpu, memory, peers, process_memory, race, update
from benchmarks.configuration import compose
from benchmarks.relay import Turns, Window
from benchmarks.sb3_loop import MISSING
from benchmarks.spread import Spread
from benchmarks.topic import Topic
from src.engine import blas
from src.experiment import process


@pytest.fixture(autouse=True)
def _threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The topics compute on one thread, as everything else in the tests may not."""
    before = torch.get_num_threads()
    for variable in process.thread_environment(1):
        monkeypatch.setenv(variable, "1")  # so that they are as they were afterwards
    yield
    torch.set_num_threads(before)


def numbers(content: Any) -> Iterator[float]:
    if isinstance(content, dict):
        for value in content.values():
            yield from numbers(value)
    elif isinstance(content, list):
        for value in content:
            yield from numbers(value)
    elif isinstance(content, int | float) and not isinstance(content, bool):
        yield content


def test_quick_topics_give_finite_positive_numbers_in_valid_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "benchmark.json"
    assert command.main(["--quick", "--only", "update", "growth", "--output", str(output)]) == 0
    content = json.loads(output.read_text(), parse_constant=lambda name: pytest.fail(f"{name} in the JSON"))
    assert content["quick"] is True
    assert set(content["topics"]) == {"update", "growth"}
    assert content["machine"]["versions"]["torch"]
    for topic in content["topics"].values():
        assert topic["rows"]
        found = list(numbers(topic["rows"]))
        assert found
        assert all(math.isfinite(x) and x > 0 for x in found)
    assert {row["actor"]: row["goal"] for row in content["topics"]["update"]["rows"]} == {"aan": 1.35, "bptsan": 1.35}
    axes = {row["axis"] for row in content["topics"]["growth"]["rows"]}
    assert axes == {"batch", "width", "time steps", "branches", "observation size"}
    shown = capsys.readouterr().out
    assert "update over its products" in shown
    assert content["machine"]["versions"]["torch"] in shown


def test_updates_and_their_products_are_timed_on_one_thread_whatever_the_environment_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    threads = []

    def timed(call: Callable[[], object]) -> float:
        call()
        threads.extend(found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas")
        return 1.0

    monkeypatch.setattr(update, "seconds", timed)
    blas.address("openblas")
    if not any(found["user_api"] == "blas" for found in threadpool_info()):
        pytest.skip("threadpoolctl knows no BLAS here (Apple's Accelerate)")
    with threadpool_limits(limits=2, user_api="blas"):  # as OPENBLAS_NUM_THREADS=2 would do, or two free cores
        update.measure(compose("protocol.update_every=1", algo="td3", env="hopper", actor="aan"), (11, 3), rounds=1)
    assert set(threads) == {1}


def test_the_floors_operations_are_those_counted_by_hand() -> None:
    """TD3 on AAN with B = 2, N = 3, M = 1, every hidden layer of 4: the products of one update, layer by layer."""
    config = compose(
        "algo.batch_size=2",
        "algo.critic_hidden_sizes=[4]",
        "actor.hidden_sizes=[4]",
        "protocol.update_every=2",
        algo="td3",
        actor="aan",
        env="hopper",
    )
    b = 2
    actor_forward = 2 * b * (3 * 4 + 4 * 1)
    critic_forward = 2 * b * (4 * 4 + 4 * 1)
    hidden_gradient = 2 * b * 4 * 1  # the last layer's input gradient
    critic_step = (
        actor_forward  # the target action
        + 2 * critic_forward  # both targets
        + 2 * (2 * critic_forward + hidden_gradient)  # both critics: forward, weights, and one input gradient
    )
    actor_step = (
        actor_forward
        + critic_forward  # the first critic alone
        + hidden_gradient
        + 2 * b * 4 * 1  # through its first layer to the action's one column
        + actor_forward  # the actor's weights
        + hidden_gradient
    )
    products = floor.products_of_a_burst(config, 3, 1)
    assert sum(p.flops for p in products) == 2 * critic_step + actor_step  # an actor's step in every second update
    run = floor.Floor(products)
    assert run.flops == 2 * critic_step + actor_step
    for product in products:
        product.out.fill_(torch.nan)
    run.run(run.best_library())
    for product in products[-4:]:  # each as its operands say, transposed or not
        torch.testing.assert_close(product.out, product.left @ product.right, rtol=1e-4, atol=1e-4)


def test_a_spiking_layer_multiplies_every_time_step_and_branch() -> None:
    def flops(*overrides: str) -> int:
        config = compose("protocol.update_every=1", *overrides, algo="td3", actor="bptsan", env="hopper")
        return sum(p.flops for p in floor.products_of_a_burst(config, 11, 3))

    b, t, wide = 100, 5, 256
    hidden = 2 * b * t * (110 * wide + wide * wide)  # of one more branch, forward
    more = flops("actor.dendritic.branches=3") - flops("actor.dendritic.branches=2")
    backward_inputs = 2 * b * t * wide * wide + 2 * b * 110 * wide  # the first layer's: B rows, linear in time
    assert more == 2 * hidden + hidden + backward_inputs  # target and actor forward, weights, inputs


def test_without_the_extra_the_sentence_is_said_and_the_rest_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, list[str]]] = []
    monkeypatch.setattr(peers, "installed", lambda: False)
    monkeypatch.setattr(peers, "_against", lambda algo, others, _: asked.append((algo, list(others))) or [])
    result = peers.topic()
    assert result.notes == [MISSING]
    assert "'.[benchmarks]'" in MISSING
    assert asked == [("td3", ["TorchRL's parts"])]


def test_a_loop_waits_between_its_turns_and_its_parts_are_told_apart() -> None:
    ours, theirs = Pipe()
    turns = Turns(theirs)
    done: list[int] = []

    def loop() -> None:
        part = turns.timed("part", lambda: None)
        step = 0
        while turns.reached(step):
            step += 50
            done.append(step)
            part()

    thread = threading.Thread(target=loop)
    thread.start()
    ours.send(100)
    assert ours.recv().steps == 100
    assert done == [50, 100]  # and no further
    ours.send(120)
    window = ours.recv()
    assert window.steps == 50
    assert 0 < window.parts["part"] < window.seconds
    ours.send(None)
    thread.join(10)
    assert not thread.is_alive()


def test_a_window_becomes_the_protocols_proportion() -> None:
    extent = race.Race(warm_up=100, window=500, rounds=1, episode_length=200)
    window = Window(500, 2.4, {"evaluation": 0.2, "checkpoint": 0.2})
    found = race.rates(window, extent, full_length=1000)
    seconds = 2.0 / 500 * 5000 + 0.2 * 5 + 0.2 / 2  # 5,000 steps, one evaluation of full episodes, half a checkpoint
    assert found.loop == pytest.approx(5000 / seconds)
    assert found.training == pytest.approx(250)


def test_a_missed_goal_is_told_from_a_kept_one() -> None:
    row = {"ratio": Spread.of([1.0, 2.0, 4.0]), "goal": 1.8}
    assert Topic("", "", goal="at least").reached(row) is True
    assert Topic("", "", goal="at most").reached(row) is False
    assert Topic("", "", goal="at most").reached({"ratio": Spread.of([1.0])}) is None


def test_sampling_copies_once(tmp_path: Path) -> None:
    assert memory.bytes_allocated_per_byte_sampled(tmp_path / "replay.bin", count=4) == pytest.approx(1.0, abs=0.01)


@pytest.mark.skipif(not psutil.LINUX, reason="only Linux tells")
def test_the_pages_of_one_file_are_found_among_the_mappings(tmp_path: Path) -> None:
    path = tmp_path / "the only file of this name"
    path.write_bytes(bytes(2**21))
    with path.open("r+b") as file, mmap.mmap(file.fileno(), 0) as mapped:
        assert mapped[::4096] == bytes(512)  # every page is read
        found = process_memory.look(os.getpid(), "the only file of this name")
    assert found["replay_resident"] == pytest.approx(2**21 / 1e6) and found["replay_anonymous"] == 0.0
    assert found["anonymous"] > 1.0 and found["file"] >= found["replay_resident"]


def test_without_a_gpu_its_topic_says_so_and_measures_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    topic = gpu.topic(quick=True)
    assert topic.rows == [] and "no CUDA GPU" in topic.notes[0]


def test_an_update_on_a_device_and_on_one_core_is_timed_in_pairs() -> None:
    device = "cuda" if torch.cuda.is_available() else "cpu"
    for spread in gpu.measure("aan", 10, device, count=2, rounds=2):
        assert spread.rounds == 2 and 0 < spread.low <= spread.median <= spread.high


def test_memory_on_a_machine_without_proc_is_a_sentence_not_zero(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process_memory.psutil, "LINUX", False)
    with pytest.raises(process_memory.FailedError, match="Linux"):
        process_memory.watch(["true"], tmp_path, tmp_path / "output", "replay.bin")
