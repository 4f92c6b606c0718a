"""`python -m server.transcoding FOLDER`: prepare what waits in a folder of uploads, then end."""

from server.transcoding.worker import main

main()
