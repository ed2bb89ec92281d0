"""How often the verdict rule is wrong, how often it sees what is there, and how often its intervals cover the truth."""
