// The window of unbend app: shows the state of the server, and sends what the user asks for.
"use strict";

const part = (id) => document.getElementById(id);
const tab = crypto.randomUUID();
// Each run of the app has a path of its own. What a tab has chosen is kept for it, and the landmarks
// placed last for all tabs.
const kept = JSON.parse(sessionStorage.getItem(location.pathname)) || {};
function placedLast() { // by result
  const last = JSON.parse(localStorage.getItem("unbend"));
  return last?.run === location.pathname ? last.placed : {};
}
const placed = placedLast();
const PLAIN = {
  spectrum: "measuring both shapes", search: "trying ways to match them", refine: "refining the map", register: "fitting",
};
let state = { version: -1, shapes: [], results: [], jobs: [], troubles: [] };
// The page of the result that is shown, and whether its shapes are open.
let frame = null, shown = null, usable = false;

// An element with attributes, listeners and children; text is never taken for HTML.
function make(name, given = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(given)) {
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (value === true) element.setAttribute(key, "");
    else if (value !== false && value !== undefined) element.setAttribute(key, value);
  }
  element.append(...children.filter((one) => one !== null && one !== undefined && one !== false));
  return element;
}

const button = (text, onclick, more = {}) => make("button", { type: "button", onclick, ...more }, text);

// Draw a part again if what it shows has changed; what has the focus keeps it.
const drawn = new Map();
function redraw(id, shows, children) {
  const text = JSON.stringify(shows);
  if (drawn.get(id) === text) return false;
  drawn.set(id, text);
  const { activeElement } = document, name = activeElement.ariaLabel || activeElement.textContent;
  const within = part(id).contains(activeElement);
  part(id).replaceChildren(...children());
  if (within) [...part(id).querySelectorAll("button")].find((one) => (one.ariaLabel || one.textContent) === name)?.focus();
  return true;
}

const say = (text) => { part("status").textContent = text; };
const remember = (change) => sessionStorage.setItem(location.pathname, JSON.stringify(Object.assign(kept, change)));

// Ask the server; what it refuses is shown as a sentence.
async function ask(method, path, body) {
  const answer = await fetch(path, { method, body });
  const found = await answer.json();
  if (!answer.ok) {
    complain(found.error);
    throw Error(found.error);
  }
  look();
  return found;
}

function complain(text, id) {
  const line = make("p", { class: "trouble" }, make("span", {}, text));
  line.append(button("Close", () => {
    line.remove();
    if (id) ask("DELETE", `troubles/${id}`);
  }));
  part("troubles").append(line);
}

async function submit(job) {
  remember({ wanted: (await ask("POST", "jobs", JSON.stringify(job))).id }); // whose result to show
  say("Started.");
}

async function upload(files, as = "shape") {
  let id = null;
  for (const file of files) {
    say(`Opening ${file.name}`);
    const begin = await file.slice(0, 1).arrayBuffer().catch(() => null);
    if (!begin) complain(`${file.name} cannot be read; if it is a folder, choose the files in it`);
    id = begin && (await ask("PUT", `files?as=${as}&name=${encodeURIComponent(file.name)}`, file).catch(() => ({ id: null }))).id;
  }
  return id;
}

// What is chosen: shapes by their numbers, the first good ones by default.
function chosen() {
  const good = state.shapes.filter((one) => one.state === "good").map(({ id }) => id);
  const first = good.includes(kept.first) ? kept.first : good.find((id) => id !== kept.second) ?? good[0];
  const second = good.includes(kept.second) ? kept.second : good.find((id) => id !== first) ?? first;
  return { good, first, second };
}

function showShapes() {
  const { good, first, second } = chosen();
  const rows = () => state.shapes.map((one) => {
    const take = (role, at, text) => one.state === "good" && button(text, () => {
      remember({ [role]: one.id });
      showShapes();
    }, { "aria-pressed": `${one.id === at}`, "aria-label": `Take ${one.name} as the ${role}` });
    const told = (one.told || []).map((text) => make("p", { class: one.state === "bad" && "bad" }, text));
    const healthy = one.state === "good" && !told.length && make("p", {}, "This shape is healthy.");
    return make("li", {},
      one.pictures?.length > 0 && make("img", { src: `shapes/${one.id}/picture?of=${one.drawn}`, alt: `Picture of ${one.name}` }),
      make("b", {}, one.name),
      make("span", { class: "hint" }, one.state === "reading" ? "Reading\u2026" : one.size || ""),
      healthy, ...told,
      make("div", { class: "row" },
        take("first", first, "First"), take("second", second, "Second"),
        one.sample && make("a", { href: `shapes/${one.id}/file`, download: one.name }, "Save"),
        button("Remove", () => ask("DELETE", `shapes/${one.id}`), { "aria-label": `Remove ${one.name}` })));
  });
  if (!redraw("shapes", [state.shapes, first, second], rows)) return;
  part("do").hidden = !good.length;
  for (const [name, id] of [["first", first], ["second", second]]) {
    part(name).replaceChildren(...state.shapes.filter((one) => one.state === "good").map(
      (one) => make("option", { value: one.id, selected: one.id === id }, one.name)));
    part(name).value = id;
  }
  for (const one of document.querySelectorAll("[data-n='2']")) one.disabled = good.length < 2;
  for (const one of document.querySelectorAll("[data-do='search'], [data-do='groups']")) one.hidden = !state.collection;
}

function showJobs() {
  part("working").hidden = !state.jobs.length;
  const known = new Map([...part("jobs").children].map((line) => [+line.dataset.id, line]));
  for (const [i, job] of state.jobs.entries()) {
    let line = known.get(job.id);
    known.delete(job.id);
    if (!line) {
      line = make("li", { "data-id": job.id }, make("b", {}, job.title),
        make("progress", { max: 1, "aria-label": job.title }), make("span"),
        button("Cancel", () => ask("DELETE", `jobs/${job.id}`), { "aria-label": `Cancel: ${job.title}` }));
      part("jobs").append(line);
    }
    const [, bar, told] = line.children;
    if (job.running && job.share) bar.value = job.share;
    else bar.removeAttribute("value");
    const stage = PLAIN[job.stage] || job.stage.replace(/^page, /, "drawing the page: ");
    if (told.textContent !== stage) {
      told.textContent = stage;
      if (!i) say(`${job.title}: ${stage}`);
    }
  }
  for (const line of known.values()) line.remove();
}

function showResults() {
  part("done").hidden = !state.results.length;
  const of = (result) => state.results.find(({ id }) => id === result);
  const at = of(kept.result) || of(shown) || state.results.at(-1); // what another page computes replaces nothing
  redraw("results", [state.results.map(({ id }) => id), at?.id], () => state.results.map((one) => button(one.title, () => {
    remember({ result: one.id });
    showResults();
  }, { "aria-pressed": `${one === at}` })));
  const open = !!at?.shapes.every((id) => state.shapes.some((one) => one.id === id));
  if (at?.id !== shown || open !== usable) {
    shown = at?.id;
    usable = open;
    frame = null;
    part("result").replaceChildren(...(at ? panel(at) : []));
  }
  if (at) showPlaced(at);
}

// All that is shown of a result.
function panel(result) {
  const { id } = result, blocks = [];
  const trust = result.confidence && make("b", {}, `The map is ${result.confidence}. `);
  if (result.facts.length) blocks.push(make("p", {}, trust, ...result.facts.map(([name, value]) => `${name}: ${value}. `)));
  for (const text of result.warnings || []) blocks.push(make("p", { class: "trouble" }, text));
  if (!usable) blocks.push(make("p", { class: "hint" }, "A shape of this result was removed. To go on, open it and do the same again."));
  else if (result.do === "landmarks") blocks.push(make("div", { class: "controls", id: "placed" }));
  if (result.page) {
    frame = make("iframe", { src: `results/${id}/page`, title: result.title, sandbox: "allow-scripts allow-downloads" });
    blocks.push(frame);
  } else {
    blocks.push(make("div", { class: "figures" }, ...result.pictures.map(({ caption }, n) => make("figure", {},
      make("img", { src: `results/${id}/pictures/${n}`, alt: caption }), make("figcaption", {}, caption)))));
  }
  if (result.found?.length) {
    blocks.push(make("h3", {}, "Open one of them here"), make("div", { class: "row" },
      ...result.found.map(({ name }, n) => button(name, async () => {
        remember({ second: (await ask("POST", `results/${id}/found/${n}`)).id });
      }, { "aria-label": `Open ${name}` }))));
  }
  if (usable && result.alternatives?.length) {
    blocks.push(make("details", { open: result.doubtful }, make("summary", {}, "Other maps, if the colours above do not agree"),
      make("ul", { class: "choices" }, ...result.alternatives.map((one, n) => make("li", {},
        make("img", { src: `results/${id}/pictures/${one.picture}`, alt: `The second shape in the colours of map ${n + 2}` }),
        make("p", {}, `Map ${n + 2}: ${one.words}`),
        make("div", { class: "row" }, button("Take this map", () => submit({ do: "choose", result: id, alternative: n }), { "aria-label": `Take map ${n + 2}` })))))));
  }
  if (usable && result.confidence) blocks.push(make("h3", {}, "Use this map"), uses(result));
  if (result.do !== "landmarks") blocks.push(make("h3", {}, "Save"), make("ul", { class: "files" },
    result.page && make("li", {}, make("a", { href: `results/${id}/page?save`, download: true }, "report.html"), " this page, which opens anywhere"),
    ...result.files.map(({ name, about }, n) => make("li", {},
      make("a", { href: `results/${id}/files/${n}`, download: name }, name), ` ${about}`))));
  for (const [head, code] of [["The same from the command line", result.command], ["The same in Python", result.python]]) {
    blocks.push(make("details", {}, make("summary", {}, head), make("pre", {}, make("code", {}, code)),
      button("Copy", async () => {
        await navigator.clipboard.writeText(code);
        say("Copied.");
      }, { "aria-label": `Copy: ${head}` })));
  }
  blocks.push(make("div", { class: "row" }, button("Remove this result", async () => {
    await ask("DELETE", `results/${id}`);
    part("results-head").focus(); // the button goes
  })));
  return blocks;
}

// What can be done with a map.
function uses(result) {
  const { id } = result;
  const steps = make("select", {}, ...[1, 3, 5, 9].map((n) => make("option", { value: n }, n)));
  const file = make("input", { type: "file" }), column = make("input", { type: "text" });
  const carry = async () => {
    const values = file.files.length ? await upload(file.files, "values") : undefined;
    if (values !== null) submit({ do: "transfer", result: id, values, column: column.value });
  };
  const again = () => submit({ do: "landmarks", shapes: result.shapes, landmarks: result.landmarks });
  if (result.do === "symmetry" || result.shapes[0] === result.shapes[1]) return make("p", { class: "hint" }, "Save it below.");
  return make("div", {},
    make("div", { class: "controls", role: "group", "aria-label": "Match again" }, button("Place landmarks and match again", again)),
    make("div", { class: "controls", role: "group", "aria-label": "Fit and morph" },
      button("Fit the first to the second", () => submit({ do: "register", result: id })),
      button("Morph", () => submit({ do: "morph", result: id, steps: +steps.value })), make("label", {}, "shapes between ", steps)),
    make("div", { class: "controls", role: "group", "aria-label": "Carry values" },
      button("Carry values to the second", carry),
      make("label", {}, "of the file ", file), make("label", {}, "property, if it is a mesh with several ", column),
      make("span", { class: "hint" }, "a table, landmarks of 3D Slicer or MeshLab, or nothing: the colours and values in the first shape\u2019s own file")));
}

// The landmarks that were placed on the page of a result, and what can be done with them.
function showPlaced(result) {
  const row = part("placed");
  if (result.do !== "landmarks" || !row) return;
  const two = result.shapes.length > 1, landmarks = complete();
  const text = landmarks.length ? `${landmarks.length} placed.` : two ? "Click the same place on both shapes." : "Click a place on the shape.";
  if (row.dataset.text === text) return;
  row.dataset.text = text;
  const act = (job) => () => submit({ ...job, shapes: result.shapes, landmarks: complete() });
  row.replaceChildren(make("span", {}, text), two
    ? button("Match with these", act({ do: "match", mirror: part("mirror").checked }), { class: "main", disabled: !landmarks.length })
    : button("Measure distances from there", act({ do: "distance" }), { class: "main", disabled: !landmarks.length }));
}

// The landmarks that are on every shape of the page in the frame.
const complete = () => (placed[shown] || []).filter(({ at }) => at.every((vertex) => vertex >= 0));

// That page tells which landmarks are on it. After a reload it is told what was placed last.
addEventListener("message", ({ source, data }) => {
  const result = state.results.find(({ id }) => id === shown);
  if (!frame || source !== frame.contentWindow || result?.do !== "landmarks" || !Array.isArray(data?.landmarks)) return;
  if (!frame.greeted) {
    frame.greeted = true;
    if (placed[shown]) return source.postMessage({ landmarks: placed[shown] }, "*");
  }
  placed[shown] = data.landmarks;
  const all = { ...placedLast(), [shown]: data.landmarks };
  localStorage.setItem("unbend", JSON.stringify({ run: location.pathname, placed: all }));
  showPlaced(result);
});

async function look() {
  const answer = await fetch(`state?seen=${state.version}&tab=${tab}`).catch(() => null);
  part("gone").hidden = answer?.ok === true;
  const found = answer?.ok ? await answer.json() : null;
  if (!found || found.version <= state.version) return;
  const before = state;
  state = found;
  part("up").value = state.up;
  showShapes();
  showJobs();
  const fresh = state.results.filter(({ id }) => !before.results.some((one) => one.id === id));
  if (before.version >= 0 && fresh.length) say(`Ready: ${fresh.at(-1).title}`);
  const ready = fresh.some(({ id }) => id === kept.wanted);
  if (ready) remember({ result: kept.wanted, wanted: null });
  showResults();
  if (ready) {
    part("results-head").focus();
    part("results-head").scrollIntoView();
  }
  for (const { id, text } of state.troubles) {
    if (!before.troubles.some((one) => one.id === id)) complain(text, id);
  }
}

async function watch() {
  await look();
  setTimeout(watch, state.jobs.length ? 300 : 1000);
}

part("choose").addEventListener("change", async ({ target }) => {
  await upload([...target.files]);
  target.value = "";
});
part("sample").addEventListener("click", () => ask("POST", "jobs", JSON.stringify({ do: "sample" })));
for (const name of ["first", "second"]) {
  part(name).addEventListener("change", ({ target }) => {
    remember({ [name]: +target.value });
    showShapes();
  });
}
part("up").addEventListener("change", ({ target }) => ask("PUT", "up", JSON.stringify({ up: target.value })));
for (const one of document.querySelectorAll("[data-do]")) {
  one.addEventListener("click", () => {
    const { first, second } = chosen();
    submit({ do: one.dataset.do, shapes: [first, second].slice(0, +one.dataset.n), mirror: part("mirror").checked });
  });
}
addEventListener("dragover", (event) => {
  event.preventDefault();
  part("drop").classList.add("over");
});
for (const kind of ["dragleave", "drop"]) addEventListener(kind, () => part("drop").classList.remove("over"));
addEventListener("drop", (event) => {
  event.preventDefault();
  upload([...event.dataTransfer.files]);
});
addEventListener("pagehide", () => navigator.sendBeacon(`bye?tab=${tab}`));
watch().then(() => { document.documentElement.dataset.ready = "yes"; });
