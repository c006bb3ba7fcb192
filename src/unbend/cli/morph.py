"""``unbend morph``: the shapes between two."""

from __future__ import annotations

from typing import Annotated

import typer

import unbend
from unbend.cli import _options as options
from unbend.cli import _output as output
from unbend.cli._input import read_or_match, read_shapes


def morph(
    source: str,
    target: str,
    out: Annotated[str, options.out()],
    steps: Annotated[int, typer.Option(metavar="N", min=1)] = 1,
    *,
    matching: options.MatchOptions,
    component: options.Component = None,
    cache: options.Cache = True,
) -> None:
    """Morph one shape into another: write the shapes between them.

    They have the source's vertices and faces. Limbs rotate about their joints rather than shrink.

      source: The mesh to begin with.
      target: The mesh to end on.
      out: The shape between (.ply, .obj, .glb, .vtp, .off, .stl); of several steps OUT-1, OUT-2 ...
      steps: How many shapes between the two, evenly spaced; 1 is the one halfway.

    $ unbend morph standing.ply leaping.ply -o halfway.ply
    $ unbend morph standing.ply leaping.ply --steps 9 -o frame.ply
    $ unbend morph standing.ply leaping.ply --map map.npz -o halfway.glb
    """
    unbend.io.check_writable(out, (".ply", ".obj", ".glb", ".vtp", ".off", ".stl"))
    files, digits = [out], len(str(steps))
    if steps > 1:
        files = [output.numbered(out, f"{i + 1:0{digits}}") for i in range(steps)]
    options.keep_inputs(files, (source, target))
    shapes = read_shapes((source, target), component)
    match = read_or_match(shapes, matching)
    told = output.numbered(out, "*") if steps > 1 else out
    like = output.what_to_keep(told, source, whole=component is None)
    for i, file in enumerate(files):
        output.progress("morphing", i / steps)
        between = unbend.morph(shapes[0], shapes[1], match, (i + 1) / (steps + 1))
        unbend.write_mesh(file, between, like=like)
    confidence = getattr(match, "confidence", None)
    count = f"{steps} between {shapes[0].name} and {shapes[1].name}"
    output.tell(
        {"source": source, "target": target, "steps": steps, "confidence": confidence},
        output.rows({"shapes": count, "confidence": output.confidence_of(match)}),
        shapes=shapes,
        written=[*files, matching.save_match],
        next_step=f"open {files[0]} in {output.viewer_of(out)}",
    )
