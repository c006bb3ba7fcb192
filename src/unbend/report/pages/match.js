// The match page: what is pointed at on one shape is marked on the other.
"use strict";

start(async (data) => {
  const { source, target, frames, forms, errors } = data;
  const camera = new Camera(), sides = [source, target];
  sides.forEach((side) => Object.assign(side, numbering(side.ids, side.places.length / 3)));
  const room = roomFor(source.places, target.places, ...frames);
  camera.up = part("up").value;
  const known = sides.map(({ partners }) => Float32Array.from(partners, (one) => (one < 0 ? 0 : 1)));
  const views = sides.map((side, i) => {
    const view = new View(part(["source", "target"][i]), camera, room);
    view.cells = data.cells;
    view.add({ positions: side.places, faces: side.faces, place: side.colors, known: known[i] });
    return view;
  });
  const [ours] = views;
  const all = forms ? [...views, ...showForms(forms, sides, known)] : views;
  listenToControls(all, views);

  // Marks: what is pointed at, else what was clicked.
  const readout = part("readout"), boxes = [part("source-vertex"), part("target-vertex")];
  let pinned = null;
  const tint = colorOf("--target");

  function mark(pair) {
    const words = ["source vertex", "target vertex"];
    const names = sides.map((side, i) =>
      pair && pair[i] >= 0 ? `${words[i]} ${count(pair.numbers[i])}` : `no ${words[i]}`);
    readout.textContent = pair ? names.join("  \u2194  ") : readout.dataset.hint;
    boxes.forEach((box, i) => { box.value = pair && pair[i] >= 0 ? pair.numbers[i] : ""; });
    all.forEach((view, v) => {
      view.marks = [];
      for (const i of pair ? (v < 2 ? [v] : [0, 1]) : []) {
        const mesh = view.meshes[v < 2 ? 0 : i];
        if (pair[i] >= 0) view.marks.push({ spot: row(mesh.positions, pair[i]), tint, mesh });
      }
      view.draw();
    });
  }

  // A shown vertex of one side and its partner; the partner that is shown stands for the true one.
  function pairOf(side, vertex) {
    const pair = [-1, -1];
    pair.numbers = [-1, -1];
    pair[side] = vertex;
    pair.numbers[side] = sides[side].number(vertex);
    pair.numbers[1 - side] = sides[side].partners[vertex];
    pair[1 - side] = sides[side].standIns[vertex];
    return pair;
  }

  all.forEach((view, v) => {
    const side = v === 1 ? 1 : 0;
    view.pointed = (vertex, clicked) => {
      const pair = vertex < 0 ? null : pairOf(side, vertex);
      if (clicked) pinned = pair;
      mark(pair || pinned);
    };
  });
  boxes.forEach((box, side) => box.addEventListener("change", () => {
    const vertex = sides[side].shown(box.valueAsNumber);
    if (vertex >= 0) {
      pinned = pairOf(side, vertex);
      mark(pinned);
    } else {
      pinned = null;
      mark(null);
      readout.textContent = "that vertex is not shown";
    }
  }));
  readout.dataset.hint = readout.textContent;

  part("paint").addEventListener("change", (event) => {
    for (const view of views) {
      view.paint = +event.target.value;
      view.draw();
    }
  });
  if (errors) {
    const counted = Float32Array.from(errors, (one) => (one > -0.5 ? 1 : 0));
    const shares = errors.map((one) => one / data.error_scale);
    const switched = () => {
      const by = part("paint").value === "1";
      ours.set(ours.meshes[0], "known", by ? counted : known[0]);
      // The target has no errors of its own: it shows those that lead to it.
      const there = Float32Array.from(target.standIns, (one) => (one < 0 ? 0 : shares[one]));
      const sure = Float32Array.from(target.standIns, (one) => (one < 0 ? 0 : counted[one]));
      views[1].set(views[1].meshes[0], "value", there);
      views[1].set(views[1].meshes[0], "known", by ? sure : known[1]);
    };
    ours.set(ours.meshes[0], "value", shares);
    part("paint").addEventListener("change", switched);
  }

  listenToMorph([source.places, ...frames], (places) => {
    ours.set(ours.meshes[0], "positions", places);
    if (pinned) mark(pinned);
  });
});

// Two views of both forms, one over the other: as they are, and the source's turned to the target's.
function showForms(forms, sides, known) {
  const camera = new Camera(20, 20);
  const names = ["source", "target"];
  const places = names.map((name) => forms[name]);
  const colors = [colorOf("--source"), colorOf("--target")];
  const { rotation: r, translation: t } = forms;
  const turned = new Float32Array(forms.source.length);
  for (let i = 0; i < turned.length; i += 3) {
    const [x, y, z] = forms.source.subarray(i, i + 3);
    for (let k = 0; k < 3; k++) turned[i + k] = r[k][0] * x + r[k][1] * y + r[k][2] * z + t[k];
  }
  return ["before", "after"].map((id, after) => {
    const view = new View(part(id), camera, roomFor(...(after ? [turned, places[1]] : places)));
    view.paint = 2;
    view.fat = 1.5;
    sides.forEach((side, i) => {
      const positions = after && i === 0 ? turned : places[i];
      view.add({ positions, faces: forms[`${names[i]}_faces`] || side.faces, tint: colors[i], place: side.colors, known: known[i] });
    });
    return view;
  });
}

// A slider from the first frame to the last, cubic in between, and a button that moves it.
function listenToMorph(frames, show) {
  const slider = part("morph");
  if (!slider) return;
  const last = frames.length - 1, places = new Float32Array(frames[0].length);
  function frameAt(share) {
    const x = share * last, first = Math.max(0, Math.min(Math.floor(x) - 1, last - 3));
    const used = [0, 1, 2, 3].map((i) => first + i).filter((i) => i <= last);
    const weights = used.map((i) => used.reduce((w, j) => (i === j ? w : w * (x - j) / (i - j)), 1));
    places.fill(0);
    used.forEach((frame, k) => {
      const from = frames[frame], weight = weights[k];
      if (weight) for (let i = 0; i < places.length; i++) places[i] += weight * from[i];
    });
    show(places);
  }
  slider.addEventListener("input", () => frameAt(+slider.value));
  let since = null;
  const button = part("play");
  button.addEventListener("click", () => {
    button.textContent = since === null ? "Stop" : "Play";
    since = since === null ? performance.now() : null;
    const tick = (now) => {
      if (since === null) return;
      slider.value = 0.5 - 0.5 * Math.cos((now - since) / 1200);
      frameAt(+slider.value);
      requestAnimationFrame(tick);
    };
    if (since !== null) requestAnimationFrame(tick);
  });
}
