"""
With PyVista
============

unbend accepts `PyVista <https://docs.pyvista.org>`_ surfaces, and its results can be stored as
their point data. The pictures on this page were drawn by PyVista, off screen.
"""

import matplotlib.pyplot as plt
import numpy as np
import pyvista as pv

from unbend import canonical_form, distance, lay_into_pose
from unbend.datasets import make_biped

person = make_biped("running", n_vertices=4000).mesh
surface = pv.PolyData.from_regular_faces(person.vertices, person.faces)

# %%
# After one function call, PyVista can show the result like any point data.
(surface["from the head"],) = distance(surface, int(person.vertices[:, 1].argmax()))
form = canonical_form(surface)
unbent = surface.copy()
unbent.points = lay_into_pose(surface, form)

# %%
plotter = pv.Plotter(off_screen=True, shape=(1, 2), window_size=(1000, 520), border=False)
for i, shape in enumerate((surface, unbent)):
    plotter.subplot(0, i)
    plotter.add_mesh(shape, scalars="from the head", cmap="viridis", smooth_shading=True,
                     show_scalar_bar=False)  # fmt: skip
    lines = shape.contour(12, scalars="from the head")
    plotter.add_mesh(lines, color="white", line_width=2)
    plotter.view_vector((0.5, 0.2, 1), viewup=(0, 1, 0))
picture = np.asarray(plotter.screenshot(return_img=True))

# %%
fig, ax = plt.subplots(figsize=(10, 5.2))
ax.imshow(picture)
ax.set_axis_off()
