"""Declarations of motion checks in the studies of the tests."""

CHECKS = """
[evidence.motion_checks]
per_block = 2
kinds = ["digit", "direction"]
clips = 12

[evidence.motion_checks.other_way]
label = { en = "I cannot see moving patterns", de = "Ich sehe keine bewegten Muster" }
text = { en = "# Thank you\\n\\nThis one is left out.", de = "# Danke" }

"""


def checked(text: str, checks: str = CHECKS) -> str:
    """A declaration with motion checks."""
    return text.replace("[trial]\n", f"{checks}[trial]\n", 1)
