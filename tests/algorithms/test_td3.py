"""TD3's losses against TorchRL's TD3Loss, in value and gradient. If these fail, TD3 is not TD3."""

import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.data import Bounded
from torchrl.modules import ValueOperator
from torchrl.objectives import TD3Loss

from src.algorithms import td3
from src.algorithms.networks import TwinCritic
from src.streams import Streams

N, M, B, DISCOUNT, LIMIT = 5, 2, 16, 0.99, 1.0


class _Actor(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.net = nn.Sequential(nn.Linear(N, 8), nn.ReLU(), nn.Linear(8, M), nn.Tanh())

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return self.net(observation)


class _Critic(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.net = nn.Sequential(nn.Linear(N + M, 8), nn.ReLU(), nn.Linear(8, 8), nn.ReLU(), nn.Linear(8, 1))

    def forward(self, observation: torch.Tensor, action: torch.Tensor) -> torch.Tensor:
        return self.net(torch.cat([observation, action], -1))


def torchrl_loss(actor: nn.Module, noise: float = 0.0) -> TD3Loss:
    loss = TD3Loss(
        TensorDictModule(actor, in_keys=["observation"], out_keys=["action"]),
        ValueOperator(_Critic(), in_keys=["observation", "action"]),
        action_spec=Bounded(-LIMIT, LIMIT, (M,)),
        policy_noise=noise,
        loss_function="l2",
        delay_actor=True,
        delay_qvalue=True,
    )
    loss.make_value_estimator(gamma=DISCOUNT)
    return loss


def copy_critic(params: TensorDict, critic: TwinCritic) -> None:
    """TorchRL's stacked critic parameters into ours."""
    for k in range(3):
        critic.networks.weights[k].data = params["module", "net", str(2 * k), "weight"].data.transpose(1, 2).clone()
        critic.networks.biases[k].data = params["module", "net", str(2 * k), "bias"].data.unsqueeze(1).clone()


def make_batch() -> TensorDict:
    torch.manual_seed(0)
    terminated = torch.zeros(B, 1, dtype=torch.bool)
    terminated[:5] = True
    done = terminated.clone()
    done[5:8] = True  # truncated, not terminated: bootstrapped through
    return TensorDict(
        {
            "observation": torch.randn(B, N),
            "action": torch.rand(B, M) * 2 - 1,
            "next": {
                "observation": torch.randn(B, N),
                "reward": torch.randn(B, 1),
                "terminated": terminated,
                "done": done,
            },
        },
        [B],
    )


def test_losses_and_gradients_equal_torchrls() -> None:
    batch, actor = make_batch(), _Actor()
    oracle = torchrl_loss(actor)
    for p in oracle.target_qvalue_network_params.values(True, True):
        p.data += 0.05 * torch.randn_like(p)  # targets differ from the online networks
    theirs = oracle(batch.clone())

    critic, target_critic = TwinCritic(N, M, (8, 8), Streams(0)), TwinCritic(N, M, (8, 8), Streams(1))
    copy_critic(oracle.qvalue_network_params, critic)
    copy_critic(oracle.target_qvalue_network_params, target_critic)
    next_observation, reward = batch["next", "observation"], batch["next", "reward"].squeeze(-1)
    terminated = batch["next", "terminated"].squeeze(-1).float()
    with torch.no_grad():
        next_action = td3.smoothed_target_action(actor(next_observation), torch.zeros(B, M), 0.5, LIMIT)
        target = td3.bellman_target(reward, terminated, target_critic(next_observation, next_action), DISCOUNT)
    loss = td3.critic_loss(critic(batch["observation"], batch["action"]), target)
    torch.testing.assert_close(loss, theirs["loss_qvalue"])

    theirs["loss_qvalue"].backward()
    ours = torch.autograd.grad(loss, list(critic.networks.weights))
    for k, gradient in enumerate(ours):
        expected = oracle.qvalue_network_params["module", "net", str(2 * k), "weight"].grad
        torch.testing.assert_close(gradient.transpose(1, 2), expected)

    action = actor(batch["observation"])
    loss = td3.actor_loss(critic(batch["observation"], action)[0])
    torch.testing.assert_close(loss, theirs["loss_actor"])
    theirs["loss_actor"].backward()
    gradients = torch.autograd.grad(loss, list(actor.parameters()))
    for gradient, name in zip(gradients, ("0", "0", "2", "2"), strict=True):
        stored = oracle.actor_network_params["module", "net", name]
        expected = stored["weight"].grad if gradient.dim() == 2 else stored["bias"].grad
        torch.testing.assert_close(gradient, expected)


def test_termination_stops_the_bootstrap_and_truncation_does_not() -> None:
    reward, values = torch.tensor([1.0, 1.0]), torch.tensor([[10.0, 10.0], [7.0, 12.0]])
    target = td3.bellman_target(reward, torch.tensor([1.0, 0.0]), values, 0.5)
    assert target.tolist() == [1.0, 6.0]  # the second: 1 + 0.5 * min(10, 12)


def test_target_smoothing_clips_the_noise_and_then_the_action() -> None:
    action, noise = torch.tensor([[0.8, 0.0, -0.9]]), torch.tensor([[2.0, -0.3, -0.05]])
    smoothed = td3.smoothed_target_action(action, noise, 0.5, 1.0)
    torch.testing.assert_close(smoothed, torch.tensor([[1.0, -0.3, -0.95]]))
