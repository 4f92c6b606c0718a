"""Where the bytes of clips lie: a folder, or an S3-compatible store."""
