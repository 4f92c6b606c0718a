"""The command `palpebra`: one way into everything, for people who installed the wheel."""
