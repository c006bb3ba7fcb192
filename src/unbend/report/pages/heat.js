// A heat map with its dendrogram: a cell for each two shapes, pointed at, clicked, or gone to by keys.

const LARGEST_CELL = 84, READABLE = 34, NAMED = 13, PICTURED = 30; // sides of a cell in pixels
const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";

// `pointed(i, j, clicked)` is called with two shapes, or -1 twice. `pictures` are canvases by shape.
// Returns what draws the map again.
function showHeatMap(canvas, { shapes, table, cells, digits, order, tree }, pictures, pointed) {
  const n = order.length, pixels = Object.assign(document.createElement("canvas"), { width: n, height: n });
  pixels.getContext("2d").putImageData(new ImageData(Uint8ClampedArray.from(cells), n, n), 0, 0);
  const context = canvas.getContext("2d"), parts = canvas.shown = { order }; // for whoever asks where cells are
  let at = null, kept = null; // row and column of the cell that is told, and of the one kept

  // The width of all and of the dendrogram, the side of a cell, the height of the pictures above.
  function measureOut() {
    const width = canvas.parentElement.clientWidth, tall = Math.min(110, width * 0.15);
    context.font = FONT;
    const names = order.map((i) => context.measureText(shapes[i].name).width);
    const room = Math.min(Math.max(...names) + 12, 150, width * 0.25);
    const beside = (count) => Math.min(LARGEST_CELL, (width - tall - room) / count);
    let cell = beside(n);
    if (cell >= PICTURED) cell = beside(n + 1);
    const top = cell >= PICTURED ? cell : 0, named = cell >= NAMED;
    if (!named) cell = (width - tall) / n;
    return { width, tall, cell, top, named };
  }

  function draw() {
    const { width, tall, cell, top, named } = Object.assign(parts, measureOut());
    const side = cell * n, height = top + side + 1, ratio = window.devicePixelRatio || 1;
    canvas.style.height = `${height}px`;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const style = getComputedStyle(document.documentElement);
    const [ink, soft, accent] = ["--ink", "--soft", "--target"].map((name) => style.getPropertyValue(name));
    context.imageSmoothingEnabled = false;
    context.drawImage(pixels, tall, top, side, side);
    context.font = FONT;
    context.textBaseline = "middle";
    if (cell >= READABLE) {
      const places = Math.max(2, Math.min(digits, Math.floor(cell / 8) - 2));
      context.textAlign = "center";
      for (let row = 0; row < n; row++) {
        for (let column = 0; column < n; column++) {
          const value = table[order[row] * n + order[column]], first = 4 * (row * n + column);
          const [r, g, b] = cells.subarray(first, first + 3);
          context.fillStyle = 0.3 * r + 0.59 * g + 0.11 * b > 125 ? "#000" : "#fff";
          const told = Number.isNaN(value) ? "?" : value.toFixed(places);
          context.fillText(told, tall + (column + 0.5) * cell, top + (row + 0.5) * cell);
        }
      }
    }
    context.textAlign = "left";
    context.fillStyle = ink;
    order.forEach((i, row) => {
      if (top) drawPicture(pictures[i], tall + row * cell, 0);
      if (!named) return;
      let x = tall + side + 6;
      if (top) {
        drawPicture(pictures[i], x - 4, top + row * cell);
        x += cell;
      }
      context.fillText(shortened(context, shapes[i].name, width - x), x, top + (row + 0.5) * cell);
    });
    context.strokeStyle = soft;
    context.beginPath();
    const across = (share) => (tall - 4) * (1 - share) + 1, down = (place) => top + (place + 0.5) * cell;
    for (const bracket of tree) {
      bracket.forEach(([share, place], i) => context[i ? "lineTo" : "moveTo"](across(share), down(place)));
    }
    context.stroke();
    if (!at) return;
    const [row, column] = at;
    context.strokeStyle = accent;
    context.lineWidth = 1;
    context.strokeRect(tall, top + row * cell, side, cell);
    context.strokeRect(tall + column * cell, top, cell, side);
    context.lineWidth = 3;
    context.strokeRect(tall + column * cell, top + row * cell, cell, cell);
  }

  // Draw a picture into the middle of a cell.
  function drawPicture(picture, x, y) {
    if (!picture?.width) return;
    const { cell } = parts, scale = cell / Math.max(picture.width, picture.height);
    const width = picture.width * scale, height = picture.height * scale;
    context.imageSmoothingEnabled = true;
    context.imageSmoothingQuality = "high";
    context.drawImage(picture, x + (cell - width) / 2, y + (cell - height) / 2, width, height);
  }

  function cellAt(event) {
    const box = canvas.getBoundingClientRect();
    const row = Math.floor((event.clientY - box.top - parts.top) / parts.cell);
    const column = Math.floor((event.clientX - box.left - parts.tall) / parts.cell);
    return [row, column].every((k) => k >= 0 && k < n) ? [row, column] : null;
  }

  function choose(place, clicked) {
    at = place;
    draw();
    pointed(...(at ? at.map((k) => order[k]) : [-1, -1]), clicked);
  }

  new ResizeObserver(draw).observe(canvas.parentElement);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  canvas.addEventListener("pointermove", (event) => {
    const place = cellAt(event);
    if (String(place) !== String(at)) choose(place || kept, false);
  });
  canvas.addEventListener("pointerleave", () => choose(kept, false));
  canvas.addEventListener("click", (event) => {
    const place = cellAt(event);
    if (place) choose(kept = place, true);
  });
  canvas.addEventListener("keydown", (event) => {
    const moves = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };
    if (event.key in moves) {
      const from = kept || [0, 0], by = kept ? moves[event.key] : [0, 0];
      kept = from.map((k, i) => Math.max(0, Math.min(n - 1, k + by[i])));
      choose(kept, false);
    } else if (event.key === "Enter" && kept) choose(kept, true);
    else return;
    event.preventDefault();
  });
  return draw;
}

function shortened(context, text, width) {
  if (context.measureText(text).width <= width) return text;
  let kept = text.length;
  while (kept > 1 && context.measureText(`${text.slice(0, kept)}\u2026`).width > width) kept--;
  return `${text.slice(0, kept)}\u2026`;
}
