// The form page: a shape beside its canonical form, eigenfunctions and distances on both.

start(async (data) => {
  const { shape, form, embedding, unit } = data, { number, shown } = numbering(shape.ids);
  const n = shape.ids.length, columns = embedding.length / n, known = Float32Array.from(shape.known);
  const camera = new Camera(), box = boxAround(shape.places), place = placesIn(box, shape.places);
  const views = ["shape", "form", "surface"].filter((name) => data[name]).map((name) => {
    const { places, faces } = data[name], view = new View(part(name), camera, roomFor(places));
    view.cells = box.cells;
    view.add({ positions: places, faces: faces || shape.faces, place, known });
    return view;
  });
  const thicken = part("thicken");
  const fatten = () => views[1].change({ fat: +thicken.value });
  thicken.addEventListener("input", fatten);
  fatten();
  listenToControls(views);

  // Spectral distance from one vertex to another, and the straight one between their points.
  function apart(table, width, i, j) {
    let square = 0;
    for (let k = 0; k < width; k++) square += (table[i * width + k] - table[j * width + k]) ** 2;
    return Math.sqrt(square);
  }

  const readout = part("readout"), entry = part("shape-vertex"), paint = part("paint");
  const tint = colorOf("--target"), hint = readout.textContent;
  let pinned = -1;

  function color() {
    const [kind, k] = paint.value.split("-");
    if (kind === "distance" || kind === "function") {
      const values = known.map((_, i) => (kind === "function" ? embedding[i * columns + +k]
        : pinned < 0 ? 0 : apart(embedding, columns, i, pinned)));
      const most = values.reduce((a, b, i) => (known[i] ? Math.max(a, Math.abs(b)) : a), 0) || 1;
      const shares = values.map((value) => value / most);
      for (const view of views) view.set("value", shares);
    }
    const kinds = { place: 0, plain: 2, distance: 1, function: 3 };
    for (const view of views) view.change({ paint: kinds[kind] });
  }

  function mark(pointed) {
    const marked = [pinned, pointed].filter((vertex) => known[vertex]);
    let told = marked.map((vertex) => `vertex ${number(vertex)}`).join(" \u2194 ") || hint;
    if (marked.length === 2) {
      told += `: biharmonic distance ${apart(embedding, columns, pinned, pointed).toFixed(4)}`;
      const straight = apart(form.places, 3, pinned, pointed) / unit;
      if (unit) told += `, straight in the form ${straight.toFixed(4)}`;
    }
    if (pointed >= 0 && !known[pointed]) {
      told = `vertex ${number(pointed)} has no place in the form, and no distances`;
    }
    readout.textContent = told;
    for (const view of views) {
      view.change({ marks: marked.map((vertex) => ({ mesh: view.meshes[0], vertex, tint })) });
    }
  }

  function pin(vertex) {
    pinned = known[vertex] ? vertex : -1;
    entry.value = vertex < 0 ? "" : number(vertex);
    mark(vertex === pinned ? -1 : vertex);
    if (paint.value === "distance") color();
  }

  for (const view of views) {
    view.pointed = (vertex, clicked) => (clicked ? pin(vertex) : mark(vertex === pinned ? -1 : vertex));
  }
  listenToBox(entry, { shown }, pin);
  paint.addEventListener("change", color);
});
