// The form page: a shape beside its canonical form, eigenfunctions and distances on both.
"use strict";

start(async (data) => {
  const { shape, form, embedding } = data;
  const n = shape.places.length / 3, columns = embedding.length / n;
  const { number, shown } = numbering(shape.ids, n);
  const camera = new Camera();
  const known = Float32Array.from(shape.known, Number);
  const views = ["shape", "form", "surface"].filter((name) => data[name]).map((name) => {
    const positions = data[name].places, faces = data[name].faces || shape.faces;
    const view = new View(part(name), camera, roomFor(positions));
    view.cells = data.cells;
    view.add({ positions, faces, place: shape.colors, known });
    return view;
  });
  const thicken = part("thicken");
  const fatten = () => views[1].change({ fat: +thicken.value });
  thicken.addEventListener("input", fatten);
  fatten();
  listenToControls(views, views);

  // Spectral distance from one vertex to another, and the straight one between their points.
  function apart(table, width, i, j) {
    let square = 0;
    for (let k = 0; k < width; k++) square += (table[i * width + k] - table[j * width + k]) ** 2;
    return Math.sqrt(square);
  }

  const readout = part("readout"), box = part("shape-vertex"), paint = part("paint");
  const tint = colorOf("--target"), hint = readout.textContent;
  let pinned = -1;

  function color() {
    const [kind, k] = paint.value.split("-");
    if (kind === "distance" || kind === "function") {
      const values = new Float32Array(n);
      for (let i = 0; i < n; i++) {
        values[i] = kind === "function" ? embedding[i * columns + +k]
          : pinned < 0 ? 0 : apart(embedding, columns, i, pinned);
      }
      const most = values.reduce((a, b, i) => (known[i] ? Math.max(a, Math.abs(b)) : a), 0) || 1;
      const shares = values.map((value) => value / most);
      for (const view of views) view.set("value", shares);
    }
    for (const view of views) view.change({ paint: { place: 0, plain: 2, distance: 1, function: 3 }[kind] });
  }

  function mark(pointed) {
    const marked = [pinned, pointed].filter((vertex) => known[vertex]);
    let far = "";
    if (marked.length === 2) {
      far = `: biharmonic distance ${apart(embedding, columns, pinned, pointed).toFixed(4)}`;
      const straight = apart(form.places, 3, pinned, pointed) / data.unit;
      if (data.unit) far += `, straight in the form ${straight.toFixed(4)}`;
    }
    readout.textContent = pointed >= 0 && !known[pointed]
      ? `vertex ${number(pointed)} has no place in the form, and no distances`
      : marked.length
      ? marked.map((vertex) => `vertex ${number(vertex)}`).join(" \u2194 ") + far
      : hint;
    for (const view of views) {
      view.change({ marks: marked.map((vertex) => ({ mesh: view.meshes[0], vertex, tint })) });
    }
  }

  function pin(vertex) {
    pinned = known[vertex] ? vertex : -1;
    box.value = vertex < 0 ? "" : number(vertex);
    mark(vertex === pinned ? -1 : vertex);
    if (paint.value === "distance") color();
  }

  for (const view of views) {
    view.pointed = (vertex, clicked) => (clicked ? pin(vertex) : mark(vertex === pinned ? -1 : vertex));
  }
  box.addEventListener("change", () => {
    const vertex = shown(box.valueAsNumber);
    pin(vertex);
    if (vertex < 0) readout.textContent = "that vertex is not shown";
  });
  paint.addEventListener("change", color);
});
