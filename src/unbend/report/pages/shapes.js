// Pages of many shapes: pictures of all, two that turn beside them, and a heat map where there is one.

start(async (data) => {
  const { shapes, measure } = data, n = shapes.length;
  data.table &&= data.table.map((value) => (value < 0 ? NaN : value));
  const readout = part("readout"), hint = readout.textContent;
  const names = ["first", "second"], choices = names.map((name) => part(`${name}-choice`));
  const camera = new Camera(), chosen = [0, 0];
  const nothing = roomFor([0, 0, 0]);
  for (const { drawn } of shapes) if (drawn) drawn.room = roomFor(drawn.places);
  const views = names.map((name) => new View(part(name), camera, nothing));
  for (const view of views) view.paint = 2;

  // Pictures, drawn one by one in a canvas that nobody sees.
  const buttons = [...document.querySelectorAll(".card")], pictures = [];
  const maker = new View(part("maker"), new Camera(), nothing);
  maker.paint = 2;
  function show(view, { drawn }) {
    view.clear();
    if (!drawn) return;
    Object.assign(view, drawn.room);
    view.add({ positions: drawn.places, faces: drawn.faces });
  }
  function drawPictures() {
    for (const button of buttons) {
      const i = +button.dataset.shape, picture = pictures[i] = button.querySelector("canvas");
      picture.width = 0;
      if (!shapes[i].drawn) continue;
      show(maker, shapes[i]);
      maker.paintNow();
      const { width, height } = maker.canvas;
      Object.assign(picture, { width, height }).getContext("2d").drawImage(maker.canvas, 0, 0);
    }
  }
  drawPictures();

  function valueOf(i, j) {
    if (data.table) return data.table[i * n + j];
    const value = i === 0 ? data.values[j] : j === 0 ? data.values[i] : undefined;
    return value === null ? NaN : value;
  }
  function tell(i, j) {
    const value = valueOf(i, j), small = value && Math.abs(value) < 1e-3;
    const known = Number.isNaN(value) ? "unknown" : small ? value.toPrecision(4) : value?.toFixed(4);
    const told = i === j || value === undefined ? "" : `: ${measure} ${known}`;
    readout.textContent = `${shapes[i].name} \u2194 ${shapes[j].name}${told}`;
  }
  function open(...pair) {
    pair.forEach((i, k) => {
      const view = views[k], { name, told } = shapes[i];
      if (chosen[k] !== i || !view.meshes.length) show(view, shapes[i]);
      view.draw();
      chosen[k] = i;
      choices[k].value = i;
      const caption = view.canvas.parentElement.querySelector("b");
      caption.textContent = shapes[i].drawn ? name : `${name}: nothing to draw`;
      caption.title = told;
      view.canvas.setAttribute("aria-label", `The shape ${name} in three dimensions.`);
    });
    for (const button of buttons) button.setAttribute("aria-pressed", chosen.includes(+button.dataset.shape));
    tell(...chosen);
  }
  // The one that is most like another.
  function nearest(i) {
    const sign = measure === "similarity" ? 1 : -1;
    const likeness = (j) => (j === i || Number.isNaN(valueOf(i, j)) ? -Infinity : sign * valueOf(i, j));
    return [...shapes.keys()].reduce((best, j) => (likeness(j) > likeness(best) ? j : best), i ? 0 : 1);
  }
  function bringIntoView() {
    document.querySelector(".views").scrollIntoView({ block: "nearest" });
  }
  for (const button of buttons) {
    const i = +button.dataset.shape;
    button.addEventListener("click", () => {
      if (data.table) open(i, nearest(i));
      else open(0, i);
      bringIntoView();
    });
  }
  choices.forEach((choice, k) => choice.addEventListener("change", () => {
    open(...chosen.map((i, other) => (other === k ? +choice.value : i)));
  }));
  listenToControls(views);

  const drawHeat = data.table && showHeatMap(part("heat"), data, pictures, (i, j, clicked) => {
    if (i < 0) tell(...chosen);
    else if (clicked) {
      open(i, j);
      bringIntoView();
    } else tell(i, j);
  });
  part("up").addEventListener("change", () => {
    drawPictures();
    drawHeat?.();
  });
  const seen = data.table ? data.order.find((i) => shapes[i].drawn) ?? data.order[0] : 0;
  open(seen, data.table ? nearest(seen) : 1);
  readout.textContent = hint;
});
