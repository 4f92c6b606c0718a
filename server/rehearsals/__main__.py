"""`python -m server.rehearsals FOLDER`: rehearse what the folder declares, then end."""

from server.rehearsals.sandbox import main

main()
