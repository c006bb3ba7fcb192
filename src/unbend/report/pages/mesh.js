// The page of one mesh: what is pointed at tells its vertex.
"use strict";

start(async ({ shape, cells }) => {
  const { number, shown } = numbering(shape.ids, shape.places.length / 3);
  const view = new View(part("shape"), new Camera(), roomFor(shape.places));
  view.cells = cells;
  view.add({ positions: shape.places, faces: shape.faces, place: shape.colors });
  listenToControls([view], [view]);
  const readout = part("readout"), hint = readout.textContent, box = part("vertex");
  const tint = colorOf("--target");
  let pinned = -1;
  function mark(vertex) {
    readout.textContent = vertex < 0 ? hint : `vertex ${count(number(vertex))}`;
    box.value = vertex < 0 ? "" : number(vertex);
    view.marks = vertex < 0 ? [] : [{ spot: row(shape.places, vertex), tint }];
    view.draw();
  }
  view.pointed = (vertex, clicked) => {
    if (clicked) pinned = vertex;
    mark(vertex < 0 ? pinned : vertex);
  };
  box.addEventListener("change", () => {
    pinned = shown(box.valueAsNumber);
    mark(pinned);
  });
});
