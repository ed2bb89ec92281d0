"""If these fail, the networks are not trained by Adam, or a resumed run forgets its moments."""

import torch

from src.algorithms.adam import FlatAdam
from src.algorithms.parameters import FlatParameters


def test_equals_torch_optim_bit_for_bit_and_survives_a_restart() -> None:
    torch.manual_seed(0)
    values = torch.randn(1000)
    oracle_parameter = torch.nn.Parameter(values.clone())
    oracle = torch.optim.Adam([oracle_parameter], lr=3e-4, eps=1e-8, fused=True)
    gradient = torch.zeros(1000)
    adam = FlatAdam(values, gradient, 3e-4)
    for step in range(20):
        gradient.copy_(torch.randn(1000))
        oracle_parameter.grad = gradient.clone()
        oracle.step()
        adam.step()
        if step == 9:
            restarted = FlatAdam(values, gradient, 3e-4)
            restarted.load_state_dict(adam.state_dict())
            adam = restarted
    assert torch.equal(values, oracle_parameter.detach())


def test_modules_keep_working_on_the_flat_values() -> None:
    torch.manual_seed(0)
    module = torch.nn.Sequential(torch.nn.Linear(3, 4), torch.nn.Linear(4, 2))
    x = torch.randn(5, 3)
    before = module(x)
    flat = FlatParameters([module])
    assert torch.equal(module(x), before)
    for p, gradient in zip(flat.parameters, torch.autograd.grad(module(x).sum(), flat.parameters), strict=True):
        flat.gradient_of[p].copy_(gradient)
    FlatAdam(flat.values, flat.gradient, 0.1).step()
    assert not torch.equal(module(x), before)
    other = FlatParameters([torch.nn.Sequential(torch.nn.Linear(3, 4), torch.nn.Linear(4, 2))])
    expected = 0.9 * other.values + 0.1 * flat.values
    other.follow(flat, 0.9)
    torch.testing.assert_close(other.values, expected)
