"""Patterns of file names such as `{character}_{speed}.mp4`: what stands in the place of each field.

As a regular expression such a pattern takes time that grows with each further field as a power of the name's
length: a few fields and one long name that does not fit kept a server busy for minutes. Here each place of a
name is looked at once a field.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

FIELD = re.compile(r"\{([A-Za-z][A-Za-z0-9_]*)\}")


@dataclass(frozen=True)
class NamePattern:
    """Texts and, between them, fields of one letter or more without a slash, each as short as it can be.

    Attributes
    ----------
    texts : tuple of str
        One more than fields.
    fields : tuple of str
    """

    texts: tuple[str, ...]
    fields: tuple[str, ...]

    @classmethod
    def read(cls, pattern: str) -> "NamePattern":
        """The pattern that stands in a text."""
        parts = FIELD.split(pattern)
        return cls(tuple(parts[::2]), tuple(parts[1::2]))

    def fit(self, name: str) -> Mapping[str, str] | None:
        """What stands for each field in a whole name; None where the name does not follow the pattern.

        >>> NamePattern.read("{face}_{speed}.mp4").fit("ada_slow.mp4")
        {'face': 'ada', 'speed': 'slow'}
        >>> NamePattern.read("{face}_{speed}.mp4").fit("ada.mp4")
        """
        if not name.startswith(self.texts[0]):
            return None
        # For each field, the places where it may begin, and from which it led nowhere.
        dead: list[set[int]] = [set() for _ in self.fields]
        begins, ends = [len(self.texts[0])], list[int]()
        while len(ends) < len(self.fields):
            number = len(begins) - 1
            end = self._next_end(name, number, begins[-1], ends_after=begins[-1], dead=dead)
            while end is None:
                dead[number].add(begins.pop())
                if not begins:
                    return None
                number -= 1
                end = self._next_end(name, number, begins[-1], ends_after=ends.pop(), dead=dead)
            ends.append(end)
            begins.append(end + len(self.texts[number + 1]))
        return {field: name[begin:end] for field, begin, end in zip(self.fields, begins, ends, strict=False)}

    def _next_end(
        self, name: str, number: int, begin: int, ends_after: int, dead: list[set[int]]
    ) -> int | None:
        """The next place where a field may end so that the rest is not known to fail."""
        text, is_last = self.texts[number + 1], number + 1 == len(self.fields)
        slash = name.find("/", begin)
        limit = len(name) if slash < 0 else slash
        if is_last:
            end = len(name) - len(text)
            return end if ends_after < end <= limit and name.endswith(text) else None
        end = name.find(text, ends_after + 1) if text else ends_after + 1
        while 0 <= end <= limit and end < len(name):
            if end + len(text) not in dead[number + 1]:
                return end
            end = name.find(text, end + 1) if text else end + 1
        return None
