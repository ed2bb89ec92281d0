"""From what a user types to a run with a name, one sentence for each mistake. Never imports torch.

A module imports only those before it: schema, rules, validation; identity (hashes, labels and paths); compose,
command_line (Hydra's side).
"""
