"""Put on PYTHONPATH by tests (:func:`tests.gate.environment`): closes the gate in every process that trains."""

import importlib.util
import json
import os
import sys


class CloseGate:
    """Finds the training session as the import system does, and closes the gate once it is loaded."""

    def find_spec(self, name, path=None, target=None):
        if name != "src.training.session":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        load = spec.loader.exec_module

        def load_and_close(module):
            load(module)
            from tests.gate import close_gate

            sys.modules[name] = module
            close_gate(**json.loads(os.environ["GATE"]))

        spec.loader.exec_module = load_and_close
        return spec


if "GATE" in os.environ:
    sys.meta_path.insert(0, CloseGate())
