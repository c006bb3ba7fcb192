"""The experiments of Yang, Obaseki and Chen (2019), run again: ``unbend reproduce``.

One module per table or figure, named in ``targets.py``; ``data.py`` finds or makes the shapes,
``run.py`` spreads the work over processes and keeps finished pieces, ``page.py`` writes what came
out.
"""
