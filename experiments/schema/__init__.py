"""How a declaration lives on: its format number and upgraders, its hash, and what an edit of it changes."""
