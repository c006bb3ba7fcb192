"""One file per mesh format: ``read(data) -> Contents``; ``write(file, vertices, faces, ...)``."""
