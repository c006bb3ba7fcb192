"""Fuzzing: what comes to hand as bytes, through every reader, and broken meshes through the rest.

``make fuzz FUZZ_SECONDS=600`` runs each family of targets for so long, guided by coverage
(atheris). A target raises what must not happen; errors of unbend's own are what should.
"""
