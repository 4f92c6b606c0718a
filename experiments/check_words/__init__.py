"""Wording of motion checks, one module per page language, named by its tag.

A language is found by its module name. To add a language to the page, add a module here. English and German
are reviewed by the authors; every other module says at its top that it awaits review.
"""

from importlib import import_module
from pkgutil import iter_modules

from experiments.check_words.words import CheckWords

WORDS: dict[str, CheckWords] = {
    module.name: import_module(f"{__name__}.{module.name}").WORDS
    for module in iter_modules(__path__)
    if module.name != "words"
}
"""Words of every language, by its tag."""
