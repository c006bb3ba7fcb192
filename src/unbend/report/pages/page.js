// What all pages do: find their parts, unpack their data, name what goes wrong.
"use strict";

const part = (id) => document.getElementById(id);

// The room that some places take: the middle of the box around them, the distance from it of the
// farthest, and for each axis the farthest across it and along it.
function roomFor(...arrays) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const each = (use) => arrays.forEach((places) => {
    for (let i = 0; i < places.length; i += 3) use(places[i], places[i + 1], places[i + 2]);
  });
  each((...place) => place.forEach((value, k) => {
    low[k] = Math.min(low[k], value);
    high[k] = Math.max(high[k], value);
  }));
  const centre = low.map((value, k) => (value + high[k]) / 2);
  const squares = [0, 0, 0];
  let most = 0;
  each((...place) => {
    const [x, y, z] = place.map((value, k) => (value - centre[k]) ** 2);
    most = Math.max(most, x + y + z);
    squares[0] = Math.max(squares[0], y + z);
    squares[1] = Math.max(squares[1], x + z);
    squares[2] = Math.max(squares[2], x + y);
  });
  const sides = squares.map((across, k) => ({
    across: Math.sqrt(across) || 1,
    along: (high[k] - low[k]) / 2,
  }));
  return { centre, radius: Math.sqrt(most) || 1, sides };
}

// Row i of a table with three columns.
const row = (table, i) => [table[3 * i], table[3 * i + 1], table[3 * i + 2]];

// A number without digits that are less than a ten-thousandth of a range.
function rounded(x, range) {
  return +x.toFixed(Math.max(0, Math.min(20, 4 - Math.floor(Math.log10(range || Math.abs(x) || 1)))));
}

// A colour of the style sheet, as three numbers from 0 to 1.
function colorOf(name) {
  const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  return [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16) / 255);
}

// The number that a shown vertex has in its file, and the shown vertex of a number, or -1.
function numbering(ids, shown) {
  if (!ids) return { number: (i) => i, shown: (id) => (Number.isInteger(id) && id >= 0 && id < shown ? id : -1) };
  const places = new Map(Array.from(ids, (id, i) => [id, i]));
  return { number: (i) => ids[i], shown: (id) => (places.has(id) ? places.get(id) : -1) };
}

// Tick boxes and buttons that every page has; the upward axis is of what `shapes` show.
function listenToControls(views, shapes) {
  const cameras = views.map((view) => view.camera);
  part("reset").addEventListener("click", () => views.forEach((view) => view.camera.reset()));
  part("linked")?.addEventListener("change", (event) => {
    views.forEach((view, i) => {
      const before = view.camera;
      before.views = before.views.filter((one) => one !== view);
      view.camera = cameras[i];
      if (!event.target.checked) view.camera = Object.assign(new Camera(), before, { views: [] });
      view.camera.views.push(view);
      view.draw();
    });
  });
  part("up").addEventListener("change", () => shapes.forEach((view) => view.draw()));
  for (const name of ["grid", "wire"]) {
    part(name)?.addEventListener("change", (event) => {
      for (const view of views) view.change({ [name]: event.target.checked });
    });
  }
  part("picture").addEventListener("click", () => savePicture(shapes));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => views.forEach((view) => view.draw()));
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
