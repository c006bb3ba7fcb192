// What all pages do: find their parts, unpack their data, name what goes wrong.

const GRID = 14; // lines across the longest side

const part = (id) => document.getElementById(id);

// The box around some places: its lowest corner, its sides, its axes, the longest first, and how
// often grid lines that make squares cross the longest and the middle side.
function boxAround(...arrays) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const places of arrays) {
    for (let i = 0; i < places.length; i++) {
      low[i % 3] = Math.min(low[i % 3], places[i]);
      high[i % 3] = Math.max(high[i % 3], places[i]);
    }
  }
  const sides = high.map((value, k) => value - low[k]);
  const axes = [0, 1, 2].sort((i, j) => sides[j] - sides[i]);
  return { low, sides, axes, cells: [GRID, GRID * sides[axes[1]] / (sides[axes[0]] || 1)] };
}

// What colours places: their shares of a box's sides, the longest first.
function placesIn({ low, sides, axes }, places) {
  return Float32Array.from(places, (_, i) => {
    const k = axes[i % 3];
    return (places[i - i % 3 + k] - low[k]) / (sides[k] || 1);
  });
}

// The room that some places take: the middle of the box around them, the distance from it of the
// farthest, and for each axis the farthest across it and along it.
function roomFor(...arrays) {
  const box = boxAround(...arrays), centre = box.low.map((value, k) => value + box.sides[k] / 2);
  const squares = [0, 0, 0];
  let most = 0;
  for (const places of arrays) {
    for (let i = 0; i < places.length; i += 3) {
      const [x, y, z] = centre.map((value, k) => (places[i + k] - value) ** 2);
      most = Math.max(most, x + y + z);
      [y + z, x + z, x + y].forEach((across, k) => { squares[k] = Math.max(squares[k], across); });
    }
  }
  const sides = squares.map((across, k) => (
    { across: Math.sqrt(across) || 1, along: box.sides[k] / 2 }));
  return { centre, radius: Math.sqrt(most) || 1, sides };
}

// What _shown.py packed, unpacked into typed arrays.
async function unpack({ data, columns, low, step }) {
  const bytes = Uint8Array.from(atob(data), (character) => character.charCodeAt(0));
  const inflated = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(inflated).arrayBuffer());
  const n = planes.length / 4, rows = n / columns, numbers = new Int32Array(n);
  for (let i = 0; i < n; i++) {
    let folded = 0;
    for (let plane = 3; plane >= 0; plane--) folded = folded * 256 + planes[plane * n + i];
    const row = i % rows, to = row * columns + Math.floor(i / rows);
    numbers[to] = (row && numbers[to - columns]) + (folded % 2 ? -(folded + 1) / 2 : folded / 2);
  }
  return low ? Float64Array.from(numbers, (value, i) => low[i % columns] + step * value) : numbers;
}

// Every packed array within a value, at any depth.
async function unpackAll(value) {
  if (value === null || typeof value !== "object") return value;
  if (typeof value.data === "string" && value.columns) return unpack(value);
  if (Array.isArray(value)) return Promise.all(value.map(unpackAll));
  const entries = Object.entries(value).map(async ([key, one]) => [key, await unpackAll(one)]);
  return Object.fromEntries(await Promise.all(entries));
}

// Row i of a table with three columns.
const row = (table, i) => [table[3 * i], table[3 * i + 1], table[3 * i + 2]];

// A number without digits that are less than a ten-thousandth of a range.
function rounded(x, range) {
  if (range < 1e-15) return +x.toPrecision(5);
  return +x.toFixed(Math.max(0, Math.min(20, 4 - Math.floor(Math.log10(range || Math.abs(x) || 1)))));
}

// A colour of the style sheet, as three numbers from 0 to 1.
function colorOf(name) {
  const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  return [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16) / 255);
}

// The number that a shown vertex has in its file, and the shown vertex of a number, or -1.
function numbering(ids) {
  const places = new Map(Array.from(ids, (id, i) => [id, i]));
  return { number: (i) => ids[i], shown: (id) => places.get(id) ?? -1 };
}

// Where the number of a vertex is typed, use the vertex that is shown, or -1.
function listenToBox(box, { shown }, use) {
  box.addEventListener("change", () => {
    const vertex = shown(box.valueAsNumber);
    use(vertex);
    if (vertex < 0) part("readout").textContent = "that vertex is not shown";
  });
}

// Tick boxes and buttons that every page has; the upward axis is of what `shapes` show.
function listenToControls(views, shapes = views) {
  const cameras = views.map((view) => view.camera);
  part("reset").addEventListener("click", () => views.forEach((view) => view.camera.reset()));
  part("linked")?.addEventListener("change", (event) => {
    views.forEach((view, i) => {
      const camera = event.target.checked ? cameras[i] : Object.assign(new Camera(), cameras[i]);
      view.change({ camera });
    });
  });
  part("up").addEventListener("change", () => shapes.forEach((view) => view.draw()));
  for (const name of ["grid", "wire"]) {
    part(name)?.addEventListener("change", (event) => {
      for (const view of views) view.change({ [name]: event.target.checked });
    });
  }
  const grid = part("grid"), paint = part("paint");
  const offerGrid = () => { grid.disabled = !["0", "place"].includes(paint.value); }; // drawn on these alone
  if (grid) {
    paint.addEventListener("change", offerGrid);
    offerGrid();
  }
  part("picture").addEventListener("click", () => savePicture(shapes));
}

// Views side by side as a picture on nothing, with twice the pixels of the screen.
function savePicture(views) {
  const ratio = 2 * (window.devicePixelRatio || 1), whole = document.createElement("canvas");
  const parts = views.map((view) => {
    const one = document.createElement("canvas");
    view.paintInto(one, ratio);
    return one;
  });
  whole.width = parts.reduce((sum, one) => sum + one.width, 0);
  whole.height = Math.max(...parts.map((one) => one.height));
  let x = 0;
  for (const one of parts) {
    if (one.width) whole.getContext("2d").drawImage(one, x, 0);
    x += one.width;
  }
  whole.toBlob((blob) => save(`${document.title}.png`, blob));
}

// Hand a file to the browser, which downloads it.
function save(name, blob) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

function complain(message) {
  part("trouble").hidden = false;
  part("trouble").textContent = message;
}

async function start(show) {
  try {
    if (!window.DecompressionStream) throw Error("This browser is older than 2023; update it to see the shapes.");
    await show(await unpackAll(JSON.parse(part("data").textContent)));
    document.documentElement.dataset.ready = "yes"; // for whoever waits for the drawing
  } catch (error) {
    complain(error.message);
    throw error;
  }
}
