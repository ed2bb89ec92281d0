"""If this fails, the first runs on a machine wait half a minute for kernels that `make setup` should have compiled."""

import re

from src.compile_kernels import main
from tests.experiment.runs import ROOT


def test_every_kernel_is_compiled(capsys) -> None:
    defined = [re.findall(r"^def \w+_kernel\(\)", p.read_text(), re.M) for p in (ROOT / "src").rglob("*_kernel.py")]
    main()
    assert capsys.readouterr().out.startswith(f"{sum(map(len, defined))} kernels compiled")
    assert sum(map(len, defined)) > 10
