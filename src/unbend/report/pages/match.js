// The match page: what is pointed at on one shape is marked on the other.

start(async ({ sides, forms, maps, landmarks, worst }) => {
  const camera = new Camera(), names = ["source", "target"];
  const tint = colorOf("--target"), plain = colorOf("--source");
  const room = roomFor(...sides.map(({ places }) => places), ...maps[0].frames);
  const box = boxAround(sides[0].places);
  const views = sides.map((side, i) => {
    Object.assign(side, numbering(side.ids));
    const view = new View(part(names[i]), camera, room);
    view.cells = box.cells;
    view.add({ positions: side.places, faces: side.faces, place: placesIn(box, side.places) });
    return view;
  });
  const aligned = showForms(forms, sides), all = [...views, ...aligned.views];
  listenToControls(all, views);

  // The map that is shown: for each side, per shown vertex, the partner's number on the other and
  // the shown vertex in whose place it is seen; -1 for none.
  let map = null;
  for (const { links } of maps) for (const one of links) one.standIns ||= one.partners;

  // Marks: what is pointed at, else what was clicked, as {side, vertex}.
  const readout = part("readout"), boxes = names.map((name) => part(`${name}-vertex`));
  const hint = readout.textContent;
  let pinned = null;

  function mark(chosen) {
    const shown = [-1, -1], numbers = [-1, -1];
    if (chosen) {
      const { side, vertex } = chosen, { standIns, partners } = map.links[side];
      [shown[side], shown[1 - side]] = [vertex, standIns[vertex]];
      [numbers[side], numbers[1 - side]] = [sides[side].number(vertex), partners[vertex]];
    }
    readout.textContent = !chosen ? hint : names.map((name, i) =>
      numbers[i] < 0 ? `no ${name} vertex` : `${name} vertex ${numbers[i]}`).join("  \u2194  ");
    boxes.forEach((one, i) => { one.value = numbers[i] < 0 ? "" : numbers[i]; });
    all.forEach((view, v) => {
      view.change({ marks: (v < 2 ? [v] : [0, 1]).filter((i) => shown[i] >= 0).map((i) => (
        { mesh: view.meshes[v < 2 ? 0 : i], vertex: shown[i], tint })) });
    });
  }

  function pin(side, vertex) {
    pinned = vertex < 0 ? null : { side, vertex };
    mark(pinned);
  }

  all.forEach((view, v) => {
    const side = v === 1 ? 1 : 0;
    view.pointed = (vertex, clicked) => {
      if (clicked) pin(side, vertex);
      else mark(vertex < 0 ? pinned : { side, vertex });
    };
  });
  boxes.forEach((one, side) => listenToBox(one, sides[side], (vertex) => pin(side, vertex)));

  const paint = part("paint");
  function color() {
    const measured = { 1: map.errors, expected: map.expected };
    const errors = measured[paint.value]?.map((one) => (one > -0.5 ? one / worst : -1));
    views.forEach((view, i) => {
      const { standIns, partners } = map.links[i];
      let known = Float32Array.from(partners, (one) => (one < 0 ? 0 : 1));
      if (errors) {
        // The target has no errors of its own: it shows those of what leads to it.
        const seen = i ? Float32Array.from(standIns, (one) => (one < 0 ? -1 : errors[one])) : errors;
        view.set("value", seen);
        known = seen.map((one) => (one < 0 ? 0 : 1));
      }
      view.set("known", known);
      view.paint = errors ? 1 : paint.value in measured ? 2 : +paint.value;
    });
  }
  paint.addEventListener("change", color);

  const morph = listenToMorph((places) => views[0].set("positions", places));

  function choose(index) {
    map = maps[index];
    views.forEach((view, i) => {
      view.landmarks = landmarks.map(({ label, at }, k) => ({
        mesh: view.meshes[0], vertex: at[i], tint: plain,
        label: map.ignored.includes(k) ? `${label} (ignored)` : label,
      }));
    });
    views[1].set("place", placesIn(box, map.carried));
    aligned.turn(map);
    color();
    morph([sides[0].places, ...map.frames]);
    mark(pinned);
  }
  choose(0);
  part("map")?.addEventListener("change", (event) => choose(+event.target.value));
});

// Two views of both forms, one over the other: as they are, and the source's turned to the target's.
function showForms(forms, sides) {
  const camera = new Camera(20, 20, "y"), colors = [colorOf("--source"), colorOf("--target")];
  const views = ["before", "after"].map((id) => {
    const view = new View(part(id), camera, roomFor(...forms.map(({ places }) => places)));
    view.paint = 2;
    view.fat = 1.5;
    forms.forEach(({ places, faces }, i) => {
      view.add({ positions: places, faces: faces || sides[i].faces, tint: colors[i] });
    });
    return view;
  });
  function turn({ rotation: r, translation: t }) {
    const [from, to] = forms.map(({ places }) => places), turned = new Float64Array(from.length);
    for (let i = 0; i < turned.length; i += 3) {
      for (let k = 0; k < 3; k++) {
        turned[i + k] = r[k][0] * from[i] + r[k][1] * from[i + 1] + r[k][2] * from[i + 2] + t[k];
      }
    }
    Object.assign(views[1], roomFor(turned, to));
    views[1].set("positions", turned);
  }
  return { views, turn };
}

// A slider from the first frame to the last, cubic in between, and a button that moves it. Returns
// what gives it other frames.
function listenToMorph(show) {
  const slider = part("morph"), button = part("play");
  let frames = [], since = null;
  function move() {
    const last = frames.length - 1, x = slider ? slider.value * last : 0;
    const first = Math.max(0, Math.min(Math.floor(x) - 1, last - 3));
    const used = [0, 1, 2, 3].map((i) => first + i).filter((i) => i <= last);
    const places = new Float64Array(frames[0].length);
    for (const i of used) {
      const from = frames[i];
      const weight = used.reduce((w, j) => (i === j ? w : w * (x - j) / (i - j)), 1);
      if (weight) for (let k = 0; k < places.length; k++) places[k] += weight * from[k];
    }
    show(places);
  }
  if (slider) {
    slider.addEventListener("input", move);
    const tick = (now) => {
      if (since === null) return;
      slider.value = 0.5 - 0.5 * Math.cos((now - since) / 1200);
      move();
      requestAnimationFrame(tick);
    };
    button.addEventListener("click", () => {
      since = since === null ? performance.now() : null;
      button.textContent = since === null ? "Play" : "Stop";
      tick(since);
    });
  }
  return (others) => {
    frames = others;
    move();
  };
}
