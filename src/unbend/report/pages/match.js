// The match page: what is pointed at on one shape is marked on the other.
"use strict";

start(async (data) => {
  const camera = new Camera(), sides = [data.source, data.target], names = ["source", "target"];
  const room = roomFor(...sides.map((side) => side.places), ...data.maps[0].frames);
  const views = sides.map((side, i) => {
    Object.assign(side, numbering(side.ids, side.places.length / 3));
    const view = new View(part(names[i]), camera, room);
    view.cells = data.cells;
    view.add({ positions: side.places, faces: side.faces, place: side.colors });
    return view;
  });
  const [ours, theirs] = views, forms = showForms(data.forms, sides);
  const all = [...views, ...forms.views];
  listenToControls(all, views);

  views.forEach((view, i) => {
    view.landmarks = data.landmarks.map((pair, k) => (
      { mesh: view.meshes[0], vertex: pair[i], tint: colorOf("--source"), label: `${k + 1}${data.ignored.includes(k) ? " (ignored)" : ""}` }));
  });

  // The map that is shown: for each side, per shown vertex, the partner's number on the other and
  // the shown vertex in whose place it is seen; -1 for none.
  let map = null;
  for (const one of data.maps) {
    for (const name of names) one[name].standIns = one[name].standIns || one[name].partners;
  }

  // Marks: what is pointed at, else what was clicked, as {side, vertex}.
  const readout = part("readout"), boxes = names.map((name) => part(`${name}-vertex`));
  const tint = colorOf("--target"), hint = readout.textContent;
  let pinned = null;

  function mark(chosen) {
    const shown = [-1, -1], numbers = [-1, -1];
    if (chosen) {
      const { side, vertex } = chosen, links = map[names[side]];
      shown[side] = vertex;
      numbers[side] = sides[side].number(vertex);
      shown[1 - side] = links.standIns[vertex];
      numbers[1 - side] = links.partners[vertex];
    }
    readout.textContent = !chosen ? hint : names.map((name, i) =>
      numbers[i] < 0 ? `no ${name} vertex` : `${name} vertex ${numbers[i]}`).join("  \u2194  ");
    boxes.forEach((box, i) => { box.value = numbers[i] < 0 ? "" : numbers[i]; });
    all.forEach((view, v) => {
      view.change({ marks: (v < 2 ? [v] : [0, 1]).filter((i) => shown[i] >= 0).map((i) => (
        { mesh: view.meshes[v < 2 ? 0 : i], vertex: shown[i], tint })) });
    });
  }

  function pin(chosen) {
    pinned = chosen;
    mark(pinned);
  }

  all.forEach((view, v) => {
    const side = v === 1 ? 1 : 0;
    view.pointed = (vertex, clicked) => {
      const chosen = vertex < 0 ? null : { side, vertex };
      if (clicked) pin(chosen);
      else mark(chosen || pinned);
    };
  });
  boxes.forEach((box, side) => box.addEventListener("change", () => {
    const vertex = sides[side].shown(box.valueAsNumber);
    pin(vertex < 0 ? null : { side, vertex });
    if (vertex < 0) readout.textContent = "that vertex is not shown";
  }));

  const paint = part("paint");
  function color() {
    const measured = { 1: map.errors, expected: map.expected }[paint.value];
    const errors = measured && measured.map((one) => (one > -0.5 ? one / data.worst : -1));
    views.forEach((view, i) => {
      const { standIns, partners } = map[names[i]];
      let known = Float32Array.from(partners, (one) => (one < 0 ? 0 : 1));
      if (errors) {
        // The target has no errors of its own: it shows those of what leads to it.
        const seen = i ? Float32Array.from(standIns, (one) => (one < 0 ? -1 : errors[one])) : errors;
        view.set("value", seen);
        known = seen.map((one) => (one < 0 ? 0 : 1));
      }
      view.set("known", known);
      view.paint = errors ? 1 : paint.value === "expected" ? 2 : +paint.value;
    });
  }
  paint.addEventListener("change", color);

  const morph = listenToMorph((places) => ours.set("positions", places));

  function choose(index) {
    map = data.maps[index];
    theirs.set("place", map.target.colors);
    forms.turn(map);
    color();
    morph([sides[0].places, ...map.frames]);
    mark(pinned);
  }
  choose(0);
  part("map")?.addEventListener("change", (event) => choose(+event.target.value));
});

// Two views of both forms, one over the other: as they are, and the source's turned to the target's.
function showForms(forms, sides) {
  const camera = new Camera(20, 20, "y"), both = [forms.source, forms.target];
  const colors = [colorOf("--source"), colorOf("--target")];
  const views = ["before", "after"].map((id) => {
    const view = new View(part(id), camera, roomFor(...both.map((form) => form.places)));
    view.paint = 2;
    view.fat = 1.5;
    both.forEach(({ places, faces }, i) => {
      view.add({ positions: places, faces: faces || sides[i].faces, tint: colors[i] });
    });
    return view;
  });
  const turned = new Float64Array(forms.source.places.length);
  function turn({ rotation: r, translation: t }) {
    const from = forms.source.places;
    for (let i = 0; i < turned.length; i += 3) {
      for (let k = 0; k < 3; k++) {
        turned[i + k] = r[k][0] * from[i] + r[k][1] * from[i + 1] + r[k][2] * from[i + 2] + t[k];
      }
    }
    Object.assign(views[1], roomFor(turned, forms.target.places));
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
    const last = frames.length - 1, x = (slider ? +slider.value : 0) * last;
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
    button.addEventListener("click", () => {
      button.textContent = since === null ? "Stop" : "Play";
      since = since === null ? performance.now() : null;
      const tick = (now) => {
        if (since === null) return;
        slider.value = 0.5 - 0.5 * Math.cos((now - since) / 1200);
        move();
        requestAnimationFrame(tick);
      };
      if (since !== null) requestAnimationFrame(tick);
    });
  }
  return (others) => {
    frames = others;
    move();
  };
}
