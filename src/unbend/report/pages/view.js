// The page of one or two meshes: vertex numbers, and landmarks placed by mouse, touch or keys.

const STEP = 12, FINE = 2; // pixels that an arrow key moves the cursor, and with Shift
const GRASP = { mouse: 10, pen: 14, touch: 24 }; // pixels from a landmark that still grasp it
const TURNS = { ArrowLeft: [-15, 0], ArrowRight: [15, 0], ArrowUp: [0, 15], ArrowDown: [0, -15] };
const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const LETTERS = { a: [10, 0], d: [-10, 0], w: [0, 10], s: [0, -10] };

start(async ({ shapes, landmarks: given }) => {
  const readout = part("readout"), paint = part("paint");
  const tint = colorOf("--target"), plain = colorOf("--source"), camera = new Camera();
  const views = shapes.map((shape, side) => {
    const { places, faces, values, known, limits } = shape, room = roomFor(places), box = boxAround(places);
    Object.assign(shape, numbering(shape.ids), { size: 2 * room.radius, cursor: -1 });
    shape.seen = (id) => shape.standIns[id] ?? -1;
    const value = limits && values.map((one) => (one - limits[0]) / (limits[1] - limits[0] || 1));
    const view = new View(part(`shape-${side}`), camera, room);
    view.cells = box.cells;
    shape.shares = placesIn(box, places);
    view.add({ positions: places, faces, place: shape.shares, value, known });
    return view;
  });
  listenToControls(views);
  function color() {
    views.forEach((view, side) => {
      const { values, colors, shares } = shapes[side], byValue = paint.value === "1";
      if (colors) view.set("place", byValue ? Float32Array.from(colors, (one) => one / 255) : shares);
      view.change({ paint: !byValue ? +paint.value : colors ? 4 : values ? 1 : 2 });
    });
  }
  paint.addEventListener("change", color);
  color();

  const landmarks = new Landmarks(shapes, given, show);
  const say = (text) => { part("status").textContent = text; };

  // The landmarks on the shapes and in the table, whose rows stay while only names change: what is
  // pressed or has the focus is then still there.
  let listed = [];
  function show() {
    views.forEach((view, side) => {
      view.change({ landmarks: landmarks.list.filter(({ at }) => at[side] >= 0).map((one) => ({
        mesh: view.meshes[0], vertex: shapes[side].seen(one.at[side]), label: one.name, one, tint: plain,
      })) });
    });
    part("undo").disabled = !landmarks.past.length;
    if (parent !== window) parent.postMessage({ landmarks: landmarks.list }, "*"); // to unbend app
    const rows = landmarks.list.flatMap((one) => [one, ...one.at]);
    if (rows.length === listed.length && rows.every((one, i) => one === listed[i])) return;
    listed = rows;
    part("landmarks").replaceChildren(...landmarks.list.map((one) => {
      const line = document.createElement("tr"), add = (what) => line.insertCell().append(what);
      const name = Object.assign(document.createElement("input"), { value: one.name, ariaLabel: "Name" });
      name.addEventListener("change", () => {
        landmarks.edit(() => { one.name = name.value.trim() || one.name; });
        name.value = one.name;
        button.ariaLabel = `Delete landmark ${one.name}`;
      });
      add(name);
      for (const vertex of one.at) add(vertex < 0 ? "\u2013" : `${vertex}`);
      const button = Object.assign(document.createElement("button"), {
        type: "button", textContent: "Delete", ariaLabel: `Delete landmark ${one.name}`,
      });
      button.addEventListener("click", () => {
        remove(one);
        part("undo").focus({ preventScroll: true }); // the button is gone
      });
      add(button);
      return line;
    }));
  }

  // What is under the pointer, or else the cursor.
  function mark(side, pointed) {
    const shape = shapes[side], vertex = pointed < 0 ? shape.cursor : pointed;
    views.forEach((view, other) => {
      const marked = other === side ? vertex : shapes[other].cursor;
      view.change({ marks: marked < 0 ? [] : [{ mesh: view.meshes[0], vertex: marked, tint }] });
    });
    part(`vertex-${side}`).value = vertex < 0 ? "" : shape.number(vertex);
    readout.textContent = vertex < 0 ? "" : told(shape, vertex);
  }

  function told({ name, number, places, size, values, known, limits, labels, label }, vertex) {
    const place = row(places, vertex).map((x) => rounded(x, size)).join(", ");
    const value = labels ? String(labels[values[vertex]]) || "none"
      : known?.[vertex] ? rounded(values[vertex], limits[1] - limits[0]) : "unknown";
    return `${name}: vertex ${number(vertex)} at (${place})${values ? `, ${label} ${value}` : ""}`;
  }

  function place(side, vertex) {
    const number = shapes[side].number(vertex), there = landmarks.list.find(({ at }) => at[side] === number);
    if (there) landmarks.selected = there; // as of a double click
    const { name } = there || landmarks.place(side, number);
    say(there ? `Landmark ${name} is at ${shapes[side].name}, vertex ${number}, already.` : `Landmark ${name} placed on ${shapes[side].name}, vertex ${number}.`);
  }

  function remove(one) {
    if (!one) return say("No landmark is selected: place one, click one, or press N.");
    landmarks.remove(one);
    say(`Landmark ${one.name} deleted.`);
  }

  function undo() {
    say(landmarks.undo() ? "Undone." : "There is nothing to undo.");
  }

  function redo() {
    say(landmarks.redo() ? "Redone." : "There is nothing to redo.");
  }

  function saveCsv() {
    const complete = landmarks.complete(), left = landmarks.list.length - complete.length;
    if (!complete.length) return say("There is nothing to save: place a landmark on every shape first.");
    save("landmarks.csv", new Blob([landmarks.csv()], { type: "text/csv" }));
    const without = left ? ` Left out, because a shape lacks them: ${left}.` : "";
    const named = shapes.length > 1 && complete.some(({ name }, i) => name !== `${i + 1}`);
    say(`Saved landmarks: ${complete.length}.${without}${named ? " Their names are saved as .mrk.json alone." : ""}`);
  }

  // Load a file onto a shape, or onto both.
  async function load(file, side) {
    try {
      const text = await file.text();
      const suffix = file.name.match(POINT_FILES)?.[1].toLowerCase();
      const moved = suffix ? landmarks.loadMarkups(text, suffix, side) : landmarks.loadCsv(text);
      say(`Loaded ${file.name}.${moved ? ` Not at the vertices they are described by, but taken where they lie: ${moved}.` : ""}`);
    } catch (error) {
      say(`${file.name} was not loaded: ${error.message}.`);
    }
  }

  part("undo").addEventListener("click", undo);
  part("save").addEventListener("click", saveCsv);
  const chosen = (input, side) => input.addEventListener("change", async () => {
    if (input.files.length) await load(input.files[0], side);
    input.value = "";
  });
  chosen(part("load"), 0);
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    const side = views.findIndex(({ canvas }) => canvas.parentElement.contains(event.target));
    for (const file of event.dataTransfer.files) {
      if (side < 0 && shapes.length > 1 && POINT_FILES.test(file.name)) say(`Drop ${file.name} onto one of the shapes.`);
      else load(file, Math.max(side, 0));
    }
  });
  document.addEventListener("keydown", (event) => {
    const key = event.key.toLowerCase();
    if (!(event.ctrlKey || event.metaKey) || !["s", "y", "z"].includes(key)) return;
    if (key !== "s" && event.target.matches("input")) return; // which undo what is typed
    event.preventDefault();
    if (key === "y" || (key === "z" && event.shiftKey)) return redo();
    if (key === "z") return undo();
    event.target.blur(); // what has been typed counts
    event.target.focus();
    saveCsv();
  });

  views.forEach((view, side) => {
    const shape = shapes[side], { canvas } = view;
    part(`markups-${side}`).addEventListener("click", () => {
      const count = landmarks.list.filter(({ at }) => at[side] >= 0).length;
      if (!count) return say(`There is no landmark on ${shape.name}.`);
      save(`${shape.name}.mrk.json`, new Blob([landmarks.markups(side)], { type: "application/json" }));
      say(`Saved landmarks on ${shape.name}: ${count}.`);
    });
    chosen(part(`load-${side}`), side);
    listenToBox(part(`vertex-${side}`), shape, (vertex) => {
      shape.cursor = vertex;
      mark(side, vertex);
    });
    view.pointed = (vertex, clicked) => {
      if (clicked && vertex >= 0) place(side, vertex);
      mark(side, vertex);
    };

    // A landmark under the pointer is dragged instead of the shape.
    let held = null;
    canvas.addEventListener("pointerdown", (event) => {
      const { offsetX: x, offsetY: y, pointerId: id } = event, project = view.projection();
      const reach = GRASP[event.pointerType || "mouse"];
      const near = view.landmarks.map((landmark) => {
        const [right, down] = project(...row(shape.places, landmark.vertex));
        return { landmark, apart: Math.hypot(right - x, down - y) };
      }).filter(({ landmark: { mesh, vertex }, apart }) => apart < reach && view.facing(mesh, vertex) > HIDDEN);
      if (!near.length || event.button || event.shiftKey) return;
      event.stopImmediatePropagation();
      canvas.setPointerCapture(id);
      const { landmark } = near.sort((a, b) => a.apart - b.apart)[0];
      held = { landmark, id, x, y, moved: false };
      landmarks.selected = landmark.one;
    }, true);
    canvas.addEventListener("pointermove", (event) => {
      if (event.pointerId !== held?.id) return;
      event.stopImmediatePropagation();
      held.moved ||= Math.hypot(event.offsetX - held.x, event.offsetY - held.y) > 3;
      const vertex = held.moved ? view.vertexAt(event.clientX, event.clientY) : -1;
      if (vertex < 0) return;
      held.landmark.vertex = vertex;
      mark(side, vertex);
    }, true);
    for (const kind of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(kind, (event) => {
        if (event.pointerId !== held?.id) return;
        event.stopImmediatePropagation();
        const { landmark: { one, vertex }, moved } = held;
        held = null;
        if (!moved) say(`Landmark ${one.name} selected.`);
        else if (kind === "pointerup") move(one, vertex);
        else show();
      }, true);
    }

    function move(one, vertex) {
      const moved = landmarks.edit(() => { one.at[side] = shape.number(vertex); });
      say(`Landmark ${one.name} ${moved ? "moved" : "stays"} on ${shape.name}, vertex ${shape.number(vertex)}.`);
    }

    // Put the cursor on the vertex seen nearest the middle.
    function begin() {
      const box = canvas.getBoundingClientRect(), project = view.projection();
      const middle = [box.width / 2, box.height / 2];
      let place = middle, least = view.vertexAt(box.left + middle[0], box.top + middle[1]) < 0 ? Infinity : 0;
      for (let vertex = 0; least > 0 && 3 * vertex < shape.places.length; vertex++) {
        const [x, y] = project(...row(shape.places, vertex)), away = Math.hypot(x - middle[0], y - middle[1]);
        if (away < least && view.vertexAt(box.left + x, box.top + y) >= 0) [place, least] = [[x, y], away];
      }
      shape.cursor = view.vertexAt(box.left + place[0], box.top + place[1]);
    }

    // Move the cursor to the next vertex seen in a direction; where there is none, turn the shape.
    function step(key, pixels) {
      if (shape.cursor < 0) return begin();
      const box = canvas.getBoundingClientRect(), [x, y] = view.projection()(...row(shape.places, shape.cursor));
      for (let d = pixels; d < Math.max(box.width, box.height); d += pixels) {
        const right = x + d * WAYS[key][0], down = y + d * WAYS[key][1];
        if (right < 0 || down < 0 || right > box.width || down > box.height) break;
        const vertex = view.vertexAt(box.left + right, box.top + down);
        if (vertex >= 0 && vertex !== shape.cursor) {
          shape.cursor = vertex;
          return;
        }
      }
      view.camera.turn(...TURNS[key]);
    }

    canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      if (key in WAYS) step(key, event.shiftKey ? FINE : STEP);
      else if (key in LETTERS) view.camera.turn(...LETTERS[key]);
      else if (key === "Escape") shape.cursor = -1;
      else if (key === "Enter" || key === " ") {
        if (shape.cursor < 0) begin();
        else place(side, shape.cursor);
      } else if (key === "Delete" || key === "Backspace") remove(landmarks.selected);
      else if (key === "m" && landmarks.selected && shape.cursor >= 0) move(landmarks.selected, shape.cursor);
      else if (key === "n" && view.landmarks.length) {
        const now = view.landmarks.findIndex(({ one }) => one === landmarks.selected);
        const { one, vertex } = view.landmarks[(now + 1) % view.landmarks.length];
        landmarks.selected = one;
        shape.cursor = vertex;
        say(`Landmark ${one.name} selected.`);
      } else return;
      event.preventDefault();
      event.stopImmediatePropagation();
      mark(side, shape.cursor);
    }, true);
  });
  // The page in whose frame this one is may put landmarks back.
  addEventListener("message", ({ source, data }) => {
    if (parent === window || source !== parent || !Array.isArray(data?.landmarks)) return;
    for (const { at } of data.landmarks) at.forEach((vertex, side) => vertex < 0 || landmarks.check(vertex, side));
    landmarks.list = data.landmarks;
    show();
  });
  show();
});
