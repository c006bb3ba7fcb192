// Landmarks: a list that is edited and undone, and the files that it is saved in.

const SCHEMA = "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/markups-schema-v1.0.3.json#";
const FARTHEST = 0.03; // from the mesh, of its size, where a loaded point may lie
const MOVED = 1e-3; // from its vertex, of the mesh's size, where a loaded point has been moved; more if that is not drawn

// Points in files of 3D Slicer and MeshLab, by the suffix of the file, as read_markups reads them.
const POINT_FILES = /\.(json|fcsv|pp)$/i;
const FLIPS = { LPS: 1, RAS: -1, 1: 1, 0: -1 };
const coordinate = (text) => (text?.trim() ? +text : NaN);
const READERS = {
  json: (text) => JSON.parse(text).markups.flatMap(({ coordinateSystem = "LPS", controlPoints }) => controlPoints.map(
    ({ label = "", description = "", position, positionStatus = "defined" }) => ({
      name: label, description, axes: coordinateSystem, place: positionStatus === "defined" ? position : [],
    }))),
  fcsv: (text) => {
    const axes = text.match(/^#.*CoordinateSystem *= *(\w+)/m)?.[1] || "RAS";
    return text.split(/\r?\n/).filter((line) => line && !line.startsWith("#")).map((line) => {
      const words = line.split(/,(?=(?:[^"]*"[^"]*")*[^"]*$)/).map((word) => word.replace(/^"(.*)"$/, "$1").replaceAll('""', '"'));
      return { name: words[11], description: words[12], axes, place: words.slice(1, 4).map(coordinate) };
    });
  },
  pp: (text) => {
    const points = new DOMParser().parseFromString(text, "text/xml");
    if (points.querySelector("parsererror")) throw Error();
    return [...points.querySelectorAll("point:not([active='0'])")].map((one) => ({
      name: one.getAttribute("name") || "", description: "", axes: "LPS", place: ["x", "y", "z"].map((axis) => coordinate(one.getAttribute(axis))),
    }));
  },
};

// Each landmark is {name, at}, `at` its vertex on each shape, by the numbers of the files, -1 for none.
class Landmarks {
  constructor(shapes, list, changed) {
    Object.assign(this, { shapes, list, changed, past: [], undone: [], selected: null });
  }

  // Edit the list by a function, so that it can be undone; tell whether that changed anything.
  edit(change) {
    const before = JSON.stringify(this.list);
    change();
    if (!this.list.includes(this.selected)) this.selected = null;
    const changed = JSON.stringify(this.list) !== before;
    if (changed) {
      this.past.push(before);
      this.undone = [];
      this.changed();
    }
    return changed;
  }

  undo() {
    return this.step(this.past, this.undone);
  }

  redo() {
    return this.step(this.undone, this.past);
  }

  step(from, to) {
    if (!from.length) return false;
    to.push(JSON.stringify(this.list));
    this.list = JSON.parse(from.pop());
    this.selected = null;
    this.changed();
    return true;
  }

  freshName() {
    let i = 1;
    while (this.list.some(({ name }) => name === `${i}`)) i++;
    return `${i}`;
  }

  // A landmark's vertex on a shape: of the first landmark that lacks one there, or of a new one.
  place(side, vertex) {
    this.edit(() => {
      let one = this.list.find(({ at }) => at[side] < 0);
      if (!one) this.list.push(one = { name: this.freshName(), at: this.shapes.map(() => -1) });
      one.at[side] = vertex;
      this.selected = one;
    });
    return this.selected;
  }

  remove(one) {
    this.edit(() => { this.list = this.list.filter((other) => other !== one); });
  }

  // Landmarks on every shape, which alone are saved as a table.
  complete() {
    return this.list.filter(({ at }) => at.every((vertex) => vertex >= 0));
  }

  csv() {
    const pairs = this.shapes.length > 1;
    const quoted = (name) => (/[#",;\s]/.test(name) ? `"${name.replaceAll('"', '""')}"` : name);
    const rows = this.complete().map(({ name, at }) => (pairs ? at.join() : `${quoted(name)},${at[0]}`));
    return `${[pairs ? "source,target" : "label,vertex", ...rows].join("\n")}\n`;
  }

  // As read_landmarks does: a nameless first column, of names of rows as R writes them, is left out.
  loadCsv(text) {
    const pairs = this.shapes.length > 1, loaded = [];
    let lines = text.replace(/^\ufeff/, "").split(/\r?\n/).filter((line) => line.trim() && (!line.startsWith("#") || /[,;\s]\d+\s*$/.test(line)));
    const header = lines.length && !/\d/.test(lines[0]) ? lines.shift().trim() : "", columns = header.toLowerCase().match(/\w+/g)?.join();
    if (header && /^(source,target|target,source)$/.test(columns) !== pairs) throw Error(`its columns are ${header.slice(0, 40)}; those of landmarks here are ${pairs ? "source,target" : "label,vertex"}`);
    if (/^[\s"]*[,;]/.test(header)) lines = lines.map((line) => line.replace(/^\s*("([^"]|"")*"|[^,;]*)[,;]/, ""));
    for (const [i, line] of lines.entries()) {
      const words = pairs ? line.replaceAll('"', " ").trim().match(/^(\d+)[\s,;]+(\d+)$/) : line.trim().match(/^(?:(.*)[\s,;]+)?(\d+)$/);
      if (!words) throw Error(`row ${i} is ${line.slice(0, 40)}; a landmark is ${pairs ? "two vertex numbers" : "a name and a vertex number"}`);
      const at = words.slice(-this.shapes.length).map(Number);
      if (columns === "target,source") at.reverse();
      at.forEach((vertex, side) => this.check(vertex, side));
      const name = pairs || words[1] === undefined ? `${i + 1}` : words[1].trim().replace(/^"(.*)"$/, "$1").replaceAll('""', '"');
      loaded.push({ name, at });
    }
    if (!loaded.length) throw Error("it holds no landmarks");
    this.edit(() => { this.list = loaded; });
  }

  check(vertex, side) {
    const { name, standIns: { length: n }, seen } = this.shapes[side];
    if (!(vertex < n)) throw Error(`vertex ${vertex} is not on ${name}, which has the vertices 0 to ${n - 1}`);
    if (seen(vertex) < 0) throw Error(`vertex ${vertex} of ${name} is in no face, and cannot be shown`);
  }

  // The landmarks on one shape, as 3D Slicer reads them.
  markups(side) {
    const { seen, places } = this.shapes[side];
    const controlPoints = this.list.filter(({ at }) => at[side] >= 0).map(({ name, at }, i) => ({
      id: `${i + 1}`, label: name, description: `vertex ${at[side]}`, position: row(places, seen(at[side])),
    }));
    const markups = [{ type: "Fiducial", coordinateSystem: "LPS", controlPoints }];
    return JSON.stringify({ "@schema": SCHEMA, markups }, null, 1);
  }

  // Points of a file on one shape, in place of those that are there; paired by their labels. A
  // described vertex tells which of several at a place is meant. Returns how many points lie elsewhere.
  loadMarkups(text, suffix, side) {
    let points;
    try {
      points = READERS[suffix](text).map(({ name, description, axes, place: [x, y, z] }) => (
        { name, description: description.trim(), place: [FLIPS[axes] * x, FLIPS[axes] * y, z] }));
    } catch {
      throw Error(`it is no landmark file of ${suffix === "pp" ? "MeshLab" : "3D Slicer"}, or a damaged one`);
    }
    if (!points.length) throw Error("it holds no points");
    const { places, seen, number, size, reach } = this.shapes[side];
    let moved = 0;
    const loaded = points.map(({ name, description, place }) => {
      const described = description.match(/^vertex (\d+)$/);
      let vertex = described && +described[1];
      if (described) this.check(vertex, side);
      const apart = described ? Math.hypot(...row(places, seen(vertex)).map((x, k) => x - place[k])) : Infinity;
      if (!(apart <= (number(seen(vertex)) === vertex ? MOVED * size : reach + MOVED * size))) {
        vertex = this.nearest(name, place, side);
        if (described) moved++;
      }
      return { name: name || this.freshName(), vertex };
    });
    this.edit(() => {
      for (const one of this.list) one.at[side] = -1;
      for (const { name, vertex } of loaded) {
        let one = this.list.find((other) => other.name === name && other.at[side] < 0);
        if (!one) this.list.push(one = { name, at: this.shapes.map(() => -1) });
        one.at[side] = vertex;
      }
      this.list = this.list.filter(({ at }) => at.some((vertex) => vertex >= 0));
    });
    return moved;
  }

  nearest(name, place, side) {
    const { places, number, size } = this.shapes[side];
    if (!place.every(Number.isFinite)) throw Error(`point ${name} has no position`);
    let best = -1, least = FARTHEST * size;
    for (let i = 0; i < places.length; i += 3) {
      const apart = Math.hypot(places[i] - place[0], places[i + 1] - place[1], places[i + 2] - place[2]);
      if (apart < least) [best, least] = [i / 3, apart];
    }
    if (best < 0) throw Error(`point ${name} is far from ${this.shapes[side].name}: is it of another mesh, unit or axes (RAS or LPS)?`);
    return number(best);
  }
}
