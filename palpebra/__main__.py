"""`python -m palpebra`."""

from palpebra.cli import main

main()
