"""What is asked about motion checks, a module a language of the page, named by its tag.

A language is found by its module's name; who adds one to the page adds its module here. English and German
are read by the authors; each other module says at its top that it awaits a reader whose language it is.
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
