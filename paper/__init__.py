"""The experiments of Yang, Obaseki and Chen (2019), run again: ``make reproduce``.

``__main__.py`` is the command line. There is one module per table or figure, named in
``targets.py``. ``data.py`` finds or makes the shapes, ``run.py`` spreads the work over processes
and keeps finished pieces, and ``page.py`` writes the results.
"""
